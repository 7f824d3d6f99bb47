//! Gradient of the queries of an attention; the scores are computed again, not stored.

use omnix_kernels::{KernelError, attention, attention_grad_q};
use smallvec::{SmallVec, smallvec};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Gradient of the queries, from the values that the attention had and made.
#[derive(Clone, Debug)]
pub struct AttentionGradQ {
    /// Scaled queries, `HeadLayout::Rows`.
    pub q: Value,
    /// Keys, `HeadLayout::KeyBlocks`.
    pub k: Value,
    /// Values, `HeadLayout::Rows`.
    pub v: Value,
    /// The attention's output, `[groups · queries, heads · head_dim]`.
    pub out: Value,
    /// The state that it kept.
    pub state: Value,
    /// Gradient of its output as heads, `HeadLayout::Rows`.
    pub d_out: Value,
}

/// The attention between `q` and `k`, as kernels take it; both are `[groups, heads, tokens, channels]`.
pub(super) fn attention_between(site: &Site<'_>, q: Value, k: Value) -> Result<attention::Attention, KernelError> {
    let (q, k) = (site.values.shape(q), site.values.shape(k));
    Ok(attention::Attention {
        groups: site.n(q[0])?,
        heads: site.n(q[1])?,
        head_dim: site.n(q[3])?,
        nq: site.n(q[2])?,
        nk: site.n(k[2])?,
        keep_state: true,
    })
}

/// The shape of padded heads in memory.
pub(super) fn padded_heads([groups, heads, tokens, channels]: [usize; 4]) -> Shape {
    Shape::from([groups, heads, tokens.next_multiple_of(32), channels.next_multiple_of(32)])
}

/// Padded words of heads, at least one.
pub(super) fn padded_words(shape: [usize; 4]) -> usize {
    padded_heads(shape).elements().max(1)
}

impl<O: Operation + From<AttentionGradQ>> Graph<O> {
    /// Gradient of the queries, `[groups, heads, queries, channels]` in `HeadLayout::Rows`, and the facts that
    /// [`Graph::attention_grad_kv`] needs. `out` and `state` are from [`Graph::attention_with_state`], `d_out` is the gradient of `out` as
    /// [`Graph::value_heads`] makes heads of it.
    ///
    /// # Errors
    /// When a shape is not that of the attention of `q` to `k` and `v`.
    pub fn attention_grad_q(
        &mut self,
        [q, k, v]: [Value; 3],
        [out, state]: [Value; 2],
        d_out: Value,
    ) -> Result<(Value, Value), GraphError> {
        let name = "attention_grad_q";
        let dims = |value: Value| {
            <[usize; 4]>::try_from(&**self.shape(value))
                .map_err(|_| self.misfit(name, value, "[groups, heads, tokens, channels]"))
        };
        let [groups, heads, queries, channels] = dims(q)?;
        let keys = dims(k)?[2];
        for value in [k, v] {
            self.expect(name, value, &[groups, heads, keys, channels])?;
        }
        self.expect(name, out, &[groups * queries, heads * channels])?;
        let padded = queries.next_multiple_of(32);
        self.expect(name, state, &[groups, heads, padded, 2])?;
        self.expect(name, d_out, &[groups, heads, queries, channels])?;
        let op = AttentionGradQ { q, k, v, out, state, d_out };
        let facts = Shape::from([groups, heads, 2, padded]);
        // Scratch: keys and values turned.
        let turned = Shape::from([2 * padded_words([groups, heads, keys, channels])]);
        let shape = [groups, heads, queries, channels];
        let outputs = self.push(op, [Shape::from(shape), facts, turned]);
        self.info_mut(outputs[0]).physical = padded_heads(shape);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for AttentionGradQ {
    fn name(&self) -> &'static str {
        "attention_grad_q"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { q, k, v, out, state, d_out } = self;
        map_all([q, k, v, out, state, d_out], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = attention_grad_q::AttentionGradQ { attention: attention_between(site, self.q, self.k)? };
        let [dq, facts, turned] = [0, 1, 2].map(|i| site.outputs[i]);
        let args = [self.q, self.k, self.v, self.out, self.d_out, self.state, dq, facts, turned].map(Some);
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        6 * values.shape(self.q).elements() as u64 * values.shape(self.k)[2] as u64
    }

    fn windowed(&self, outputs: &[Value]) -> SmallVec<[Value; 2]> {
        smallvec![self.k, outputs[2]]
    }
}
