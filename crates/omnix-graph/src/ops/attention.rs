//! `softmax(q kᵀ) v` per group and head; the scores are never stored.

use omnix_kernels::{KernelError, attention};
use smallvec::{SmallVec, smallvec};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Access, Call, Graph, Operation, RowWise, Shape, Site, Value, Values};

/// Attention of queries to keys.
#[derive(Clone, Debug)]
pub struct Attention {
    /// Scaled queries, `HeadLayout::Rows`.
    pub q: Value,
    /// Keys, `HeadLayout::KeyBlocks`.
    pub k: Value,
    /// Values, `HeadLayout::Rows`.
    pub v: Value,
    /// Sequences that do not see each other.
    pub groups: usize,
    /// Queries of one.
    pub queries: usize,
    /// Keys of one.
    pub keys: usize,
    /// Heads.
    pub heads: usize,
    /// Channels of a head.
    pub head_dim: usize,
    /// Whether the second output, the running maximum and sum of each query, is wanted.
    pub keep_state: bool,
}

impl<O: Operation + From<Attention>> Graph<O> {
    /// `softmax(q kᵀ) v`: `[groups · queries, heads · head_dim]`.
    ///
    /// # Errors
    /// When the three do not have the same groups, heads and channels.
    pub fn attention(&mut self, q: Value, k: Value, v: Value) -> Result<Value, GraphError> {
        Ok(self.attention_of(q, k, v, false)?.0)
    }

    /// [`Graph::attention`], and what its gradients need of the softmax, `[groups, heads, padded queries, 2]`: the largest score of
    /// a query and the sum of exponentials relative to it.
    ///
    /// # Errors
    /// As [`Graph::attention`].
    pub fn attention_with_state(&mut self, q: Value, k: Value, v: Value) -> Result<(Value, Value), GraphError> {
        self.attention_of(q, k, v, true)
    }

    fn attention_of(&mut self, q: Value, k: Value, v: Value, keep_state: bool) -> Result<(Value, Value), GraphError> {
        let dims = |value: Value| {
            <[usize; 4]>::try_from(&**self.shape(value))
                .map_err(|_| self.misfit("attention", value, "[groups, heads, tokens, channels]"))
        };
        let [groups, heads, queries, head_dim] = dims(q)?;
        let [key_groups, key_heads, keys, key_dim] = dims(k)?;
        if [key_groups, key_heads, key_dim] != [groups, heads, head_dim] {
            return Err(self.misfit("attention", k, format!("[{groups}, {heads}, keys, {head_dim}]")));
        }
        self.expect("attention", v, &[groups, heads, keys, head_dim])?;
        let op = Attention { q, k, v, groups, queries, keys, heads, head_dim, keep_state };
        // Second output: running maximum and sum of each query, for kernels that see the keys in windows.
        let state = Shape::from([groups, heads, queries.next_multiple_of(32), 2]);
        let out = Shape::from([groups * queries, heads * head_dim]);
        let outputs = self.push(op, [out, state]);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for Attention {
    fn name(&self) -> &'static str {
        "attention"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.q, &mut self.k, &mut self.v], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (groups, queries) = site.groups(self.groups, self.queries);
        let spec = attention::Attention {
            groups: site.n(groups)?,
            heads: site.n(self.heads)?,
            head_dim: site.n(self.head_dim)?,
            nq: site.n(queries)?,
            nk: site.n(self.keys)?,
            keep_state: self.keep_state,
        };
        let args = [self.q, self.k, self.v, site.outputs[0], site.outputs[1]].map(Some);
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        4 * (self.groups * self.queries * self.keys * self.heads * self.head_dim) as u64
    }

    fn row_wise(&self, _: &Values) -> Option<RowWise> {
        if self.keep_state {
            // Its layout would depend on the chunk.
            return None;
        }
        let outputs = smallvec![Access::Rows, Access::Interior];
        Some(if self.groups == 1 {
            // Queries made in the chain bring their own unit; with 64 here, whole images would never divide it.
            let inputs = SmallVec::from_slice(&[Access::Interior, Access::Whole, Access::Whole]);
            RowWise { rows: self.queries, unit: 1, inputs, outputs }
        } else {
            RowWise { outputs, ..RowWise::new(self.groups * self.queries, self.queries, 3, 0) }
        })
    }

    fn windowed(&self, _: &[Value]) -> SmallVec<[Value; 2]> {
        smallvec![self.k, self.v]
    }
}
