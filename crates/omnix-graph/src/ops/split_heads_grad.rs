//! Gradients of columns that became heads: back to tokens, turned back, through the norm.

use omnix_kernels::split_heads::HeadLayout;
use omnix_kernels::{KernelError, split_heads, split_heads_grad};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

use super::split_heads::SplitHeads;

/// Gradients of a `split_heads`.
#[derive(Clone, Debug)]
pub struct SplitHeadsGrad {
    /// The operation whose gradients they are.
    pub heads: SplitHeads,
    /// Gradient of its output, `[groups, heads, tokens, channels]` in `HeadLayout::Rows` whatever the layout of the output.
    pub dy: Value,
}

impl SplitHeadsGrad {
    fn spec(&self, values: &Values) -> Result<split_heads_grad::SplitHeadsGrad, KernelError> {
        let n = |n: usize| u32_of("split_heads_grad", n);
        let of = &self.heads;
        let heads = split_heads::SplitHeads {
            groups: n(of.groups)?,
            tokens: n(of.tokens)?,
            heads: n(of.heads)?,
            head_dim: n(of.head_dim)?,
            x_stride: n(values.shape(of.x).width())?,
            x_offset: n(of.offset)?,
            norm: of.norm.map(|(_, _, eps)| eps),
            rope_rows: of.rope.map(|table| n(values.shape(table)[0])).transpose()?,
            scale: of.scale,
            layout: HeadLayout::Rows,
        };
        Ok(split_heads_grad::SplitHeadsGrad { heads, dx_stride: n(of.heads * of.head_dim)?, dx_offset: 0 })
    }
}

impl<O: Operation + From<SplitHeadsGrad>> Graph<O> {
    /// Gradient of the columns that `heads` took, `[groups · tokens, heads · head_dim]`, and with a norm those of its weight and bias,
    /// `[head_dim]` each. `dy` is the gradient of its output, in `HeadLayout::Rows`.
    ///
    /// # Errors
    /// When `dy` does not have the shape of the output.
    pub fn split_heads_grad(
        &mut self,
        heads: SplitHeads,
        dy: Value,
    ) -> Result<(Value, Option<[Value; 2]>), GraphError> {
        let SplitHeads { groups, tokens, heads: count, head_dim, norm, .. } = heads;
        self.expect("split_heads_grad", dy, &[groups, count, tokens, head_dim])?;
        let op = SplitHeadsGrad { heads, dy };
        let spec = op.spec(self)?;
        let channels = || Shape::from([if norm.is_some() { head_dim } else { 1 }]);
        // Scratch: statistics of heads, and the sums of sections, at least 1, since a value has memory.
        let scratch = [spec.stats_words(), spec.parts_words()].map(|words| Shape::from([words.max(1) as usize]));
        let dx = Shape::from([groups * tokens, count * head_dim]);
        let outputs = self.push(op, [dx, channels(), channels()].into_iter().chain(scratch));
        Ok((outputs[0], norm.map(|_| [outputs[1], outputs[2]])))
    }
}

impl Operation for SplitHeadsGrad {
    fn name(&self) -> &'static str {
        "split_heads_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        // The norm's bias has no part in the gradients.
        let weight = self.heads.norm.iter_mut().map(|(weight, _, _)| weight);
        map_all([&mut self.heads.x, &mut self.dy].into_iter().chain(weight).chain(&mut self.heads.rope), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let weight = self.heads.norm.map(|(weight, _, _)| weight);
        let outputs = site.outputs.iter().copied().map(Some);
        let args = [Some(self.heads.x), weight, self.heads.rope, Some(self.dy)].into_iter().chain(outputs);
        site.call(args, self.spec(site.values)?.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        12 * values.shape(outputs[0]).elements() as u64
    }
}
