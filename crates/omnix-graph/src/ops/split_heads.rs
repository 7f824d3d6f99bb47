//! Columns of tokens as heads: split, normalise each head, rotate (RoPE), scale, and lay out as attention reads them. See
//! `omnix_kernels::split_heads`.

use omnix_kernels::split_heads::HeadLayout;
use omnix_kernels::{KernelError, split_heads};
use smallvec::smallvec;

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Access, Call, Graph, Operation, RowWise, Shape, Site, Value, Values};

/// The widest head that attention takes.
pub const WIDEST_HEAD: usize = 128;

/// A head-major tensor out of some columns of rows of tokens.
#[derive(Clone, Debug)]
pub struct SplitHeads {
    /// `[groups · tokens, width]`.
    pub x: Value,
    /// First column.
    pub offset: usize,
    /// Sequences that do not see each other.
    pub groups: usize,
    /// Tokens of one.
    pub tokens: usize,
    /// Heads.
    pub heads: usize,
    /// Channels of a head.
    pub head_dim: usize,
    /// Layer norm over the channels of a head: weight, bias, eps.
    pub norm: Option<(Value, Value, f32)>,
    /// RoPE table `[rows, head_dim]`: cosines then sines.
    pub rope: Option<Value>,
    /// Applied last.
    pub scale: f32,
    /// What the attention reads it as.
    pub layout: HeadLayout,
}

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
    /// Channels of a head, up to `omnix_kernels::attention`'s widest; even where there is a RoPE table.
    pub head_dim: usize,
    /// Normalise each head.
    pub norm: Option<HeadNorm>,
    /// RoPE table `[rows, head_dim]`, row `t % rows` for token t: cosines then sines.
    pub rope: Option<Value>,
}

impl<O: Operation + From<SplitHeads>> Graph<O> {
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
        if groups == 0 || !rows.is_multiple_of(groups) || offset + heads * head_dim > width {
            let expected = format!("{groups} x tokens rows of at least {} columns", offset + heads * head_dim);
            return Err(self.misfit("split_heads", x, expected));
        }
        if let Some(norm) = norm {
            self.expect("split_heads", norm.weight, &[head_dim])?;
            self.expect("split_heads", norm.bias, &[head_dim])?;
        }
        if let Some(rope) = rope {
            let table = self.shape(rope);
            if table.len() != 2 || table[1] != head_dim || table[0] == 0 {
                return Err(self.misfit("split_heads", rope, format!("[rows, {head_dim}]")));
            }
        }
        let tokens = rows / groups;
        let norm = norm.map(|n| (n.weight, n.bias, n.eps));
        let op = SplitHeads { x, offset, groups, tokens, heads, head_dim, norm, rope, scale, layout };
        let value = self.push_one(op, [groups, heads, tokens, head_dim]);
        // The kernels' layouts pad tokens and channels to 32.
        let padded = [groups, heads, tokens.next_multiple_of(32), head_dim.next_multiple_of(32)];
        self.info_mut(value).physical = Shape::from(padded);
        Ok(value)
    }
}

impl Operation for SplitHeads {
    fn name(&self) -> &'static str {
        "split_heads"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let norm = self.norm.iter_mut().flat_map(|(w, b, _)| [w, b]);
        map_all([&mut self.x].into_iter().chain(norm).chain(&mut self.rope), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (groups, tokens) = site.groups(self.groups, self.tokens);
        let spec = split_heads::SplitHeads {
            groups: site.n(groups)?,
            tokens: site.n(tokens)?,
            heads: site.n(self.heads)?,
            head_dim: site.n(self.head_dim)?,
            x_stride: site.width(self.x)?,
            x_offset: site.n(self.offset)?,
            norm: self.norm.map(|(_, _, eps)| eps),
            rope_rows: self.rope.map(|table| site.n(site.values.shape(table)[0])).transpose()?,
            scale: self.scale,
            layout: self.layout,
        };
        let (weight, bias) = self.norm.map_or((None, None), |(w, b, _)| (Some(w), Some(b)));
        site.call([Some(self.x), weight, bias, self.rope, Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        4 * values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        let whole = self.inputs().len() - 1;
        if self.groups > 1 {
            return Some(RowWise::new(self.groups * self.tokens, self.tokens, 1, whole));
        }
        // Keys and values of one long sequence are read whole by every query, so only queries go in chunks.
        // A RoPE table that repeats every image makes the chunks whole images.
        let unit = self.rope.map_or(64, |table| values.shape(table)[0]);
        if self.layout != HeadLayout::Rows || !self.tokens.is_multiple_of(unit) && self.rope.is_some() {
            return None;
        }
        Some(RowWise { outputs: smallvec![Access::Interior], ..RowWise::new(self.tokens, unit, 1, whole) })
    }
}
