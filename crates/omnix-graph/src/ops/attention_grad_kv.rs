//! Gradients of the keys and values of an attention; the scores are computed again, not stored.

use omnix_kernels::{KernelError, attention_grad_kv};
use smallvec::{SmallVec, smallvec};

use super::attention_grad_q::{attention_between, padded_heads, padded_words};
use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Gradients of keys and values, from the values that the attention had and the facts that the queries' gradient left.
#[derive(Clone, Debug)]
pub struct AttentionGradKv {
    /// Scaled queries, `HeadLayout::Rows`.
    pub q: Value,
    /// Keys, `HeadLayout::KeyBlocks`.
    pub k: Value,
    /// Values, `HeadLayout::Rows`.
    pub v: Value,
    /// Gradient of the attention's output as heads, `HeadLayout::Rows`.
    pub d_out: Value,
    /// From [`Graph::attention_grad_q`].
    pub facts: Value,
}

impl<O: Operation + From<AttentionGradKv>> Graph<O> {
    /// Gradients of keys and of values, both `[groups, heads, keys, channels]` in `HeadLayout::Rows`. `d_out` is what
    /// [`Graph::attention_grad_q`] had, `facts` what it made.
    ///
    /// # Errors
    /// When a shape is not that of the attention of `q` to `k` and `v`.
    pub fn attention_grad_kv(
        &mut self,
        [q, k, v]: [Value; 3],
        d_out: Value,
        facts: Value,
    ) -> Result<(Value, Value), GraphError> {
        let name = "attention_grad_kv";
        let dims = |value: Value| {
            <[usize; 4]>::try_from(&**self.shape(value))
                .map_err(|_| self.misfit(name, value, "[groups, heads, tokens, channels]"))
        };
        let [groups, heads, queries, channels] = dims(q)?;
        let keys = dims(k)?[2];
        let shape = [groups, heads, keys, channels];
        for value in [k, v] {
            self.expect(name, value, &shape)?;
        }
        self.expect(name, d_out, &[groups, heads, queries, channels])?;
        self.expect(name, facts, &[groups, heads, 2, queries.next_multiple_of(32)])?;
        // Scratch: queries and gradients turned.
        let turned = Shape::from([2 * padded_words([groups, heads, queries, channels])]);
        let op = AttentionGradKv { q, k, v, d_out, facts };
        let outputs = self.push(op, [Shape::from(shape), Shape::from(shape), turned]);
        for value in &outputs[..2] {
            self.info_mut(*value).physical = padded_heads(shape);
        }
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for AttentionGradKv {
    fn name(&self) -> &'static str {
        "attention_grad_kv"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { q, k, v, d_out, facts } = self;
        map_all([q, k, v, d_out, facts], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = attention_grad_kv::AttentionGradKv { attention: attention_between(site, self.q, self.k)? };
        let [dk, dv, turned] = [0, 1, 2].map(|i| site.outputs[i]);
        let args = [self.q, self.k, self.v, self.d_out, self.facts, dk, dv, turned].map(Some);
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        8 * values.shape(self.q).elements() as u64 * values.shape(self.k)[2] as u64
    }

    fn windowed(&self, outputs: &[Value]) -> SmallVec<[Value; 2]> {
        smallvec![self.q, self.d_out, outputs[2]]
    }
}
