//! Attention over tokens.

use crate::error::GraphError;
use crate::graph::{Graph, Shape, Value};
use crate::op::{Attention, HeadLayout, Op, SplitHeads};

/// Layer norm over the channels of a head.
#[derive(Clone, Copy, Debug)]
pub struct HeadNorm {
    /// `[head_dim]`.
    pub weight: Value,
    /// `[head_dim]`.
    pub bias: Value,
    /// Added to the variance.
    pub eps: f32,
}

/// How columns of tokens become heads.
#[derive(Clone, Copy, Debug)]
pub struct Heads {
    /// Sequences that do not see each other; the rows are `groups` sequences one after the other.
    pub groups: usize,
    /// Number of heads.
    pub heads: usize,
    /// Channels of a head; a multiple of 8.
    pub head_dim: usize,
    /// Normalise each head.
    pub norm: Option<HeadNorm>,
    /// RoPE table `[rows, head_dim]`, row `t % rows` for token t: cosines then sines.
    pub rope: Option<Value>,
}

impl Graph {
    /// Columns `offset..offset + heads · head_dim` of `x [rows, width]` as queries, scaled by `1/sqrt(head_dim)`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn query_heads(&mut self, x: Value, offset: usize, heads: &Heads) -> Result<Value, GraphError> {
        self.split_heads(x, offset, heads, 1.0 / (heads.head_dim as f32).sqrt(), HeadLayout::Rows)
    }

    /// Columns of `x` as keys.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn key_heads(&mut self, x: Value, offset: usize, heads: &Heads) -> Result<Value, GraphError> {
        self.split_heads(x, offset, heads, 1.0, HeadLayout::KeyBlocks)
    }

    /// Columns of `x` as values: neither normalised nor rotated.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn value_heads(&mut self, x: Value, offset: usize, heads: &Heads) -> Result<Value, GraphError> {
        self.split_heads(x, offset, &Heads { norm: None, rope: None, ..*heads }, 1.0, HeadLayout::Rows)
    }

    fn split_heads(
        &mut self,
        x: Value,
        offset: usize,
        spec: &Heads,
        scale: f32,
        layout: HeadLayout,
    ) -> Result<Value, GraphError> {
        let Heads { groups, heads, head_dim, norm, rope } = *spec;
        let (rows, width) = (self.shape(x).rows(), self.shape(x).width());
        if !rows.is_multiple_of(groups) || offset + heads * head_dim > width {
            let expected = format!("{groups} x tokens rows of at least {} columns", offset + heads * head_dim);
            return Err(self.misfit("split_heads", x, expected));
        }
        if let Some(norm) = norm {
            self.expect("split_heads", norm.weight, &[head_dim])?;
            self.expect("split_heads", norm.bias, &[head_dim])?;
        }
        if let Some(rope) = rope {
            let table = self.shape(rope);
            if table.len() != 2 || table[1] != head_dim {
                return Err(self.misfit("split_heads", rope, format!("[rows, {head_dim}]")));
            }
        }
        let tokens = rows / groups;
        let norm = norm.map(|n| (n.weight, n.bias, n.eps));
        let op = SplitHeads { x, offset, groups, tokens, heads, head_dim, norm, rope, scale, layout };
        let value = self.push_one(Op::SplitHeads(op), [groups, heads, tokens, head_dim]);
        // The kernels' layouts pad tokens and channels to 32.
        let padded = [groups, heads, tokens.next_multiple_of(32), head_dim.next_multiple_of(32)];
        self.values[value.0 as usize].physical = Shape::from(padded);
        Ok(value)
    }

    /// `softmax(q kᵀ) v`: `[groups · queries, heads · head_dim]`.
    ///
    /// # Errors
    /// When the three do not have the same groups, heads and channels.
    pub fn attention(&mut self, q: Value, k: Value, v: Value) -> Result<Value, GraphError> {
        let dims = |g: &Self, value: Value| <[usize; 4]>::try_from(&**g.shape(value)).unwrap_or_default();
        let [groups, heads, queries, head_dim] = dims(self, q);
        let [key_groups, key_heads, keys, key_dim] = dims(self, k);
        if [key_groups, key_heads, key_dim] != [groups, heads, head_dim] {
            return Err(self.misfit("attention", k, format!("[{groups}, {heads}, keys, {head_dim}]")));
        }
        self.expect("attention", v, &[groups, heads, keys, head_dim])?;
        let op = Attention { q, k, v, groups, queries, keys, heads, head_dim };
        // Second output: running maximum and sum of each query, for kernels that see the keys in windows.
        let state = Shape::from([groups, heads, queries.next_multiple_of(32), 2]);
        let out = Shape::from([groups * queries, heads * head_dim]);
        Ok(self.push(Op::Attention(op), [out, state])[0])
    }
}
