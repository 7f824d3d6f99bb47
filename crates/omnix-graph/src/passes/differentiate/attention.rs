//! Gradients of attention, and of columns that become heads. The scores are computed again: none are stored.

use omnix_kernels::copy::{Copy as StridedCopy, Strided};

use super::gradients::{Gradients, Made, Rule};
use crate::error::{GraphError, u32_of};
use crate::graph::Value;
use crate::ops::{Attention, Graph, Heads, SplitHeads};

impl Rule for Attention {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (out, Some(dy)) = node.first() else { return Ok(()) };
        let Self { q, k, v, groups, heads, head_dim, .. } = *self;
        let spec = Heads { groups, heads, head_dim, norm: None, rope: None };
        let d_out = graph.value_heads(dy, 0, &spec)?;
        // The facts of the softmax come with the queries' gradient, whether that is wanted or not.
        let (dq, facts) = graph.attention_grad_q([q, k, v], [out, node.outputs[1]], d_out)?;
        gradients.add(graph, q, dq)?;
        if gradients.wants(k) || gradients.wants(v) {
            let (dk, dv) = graph.attention_grad_kv([q, k, v], d_out, facts)?;
            gradients.add(graph, k, dk)?;
            gradients.add(graph, v, dv)?;
        }
        Ok(())
    }
}

impl Rule for SplitHeads {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let (dx, norm) = graph.split_heads_grad(self.clone(), dy)?;
        if gradients.wants(self.x) {
            let dx = in_columns(graph, dx, self)?;
            gradients.add(graph, self.x, dx)?;
        }
        if let (Some((weight, bias, _)), Some([d_weight, d_bias])) = (self.norm, norm) {
            gradients.add(graph, weight, d_weight)?;
            gradients.add(graph, bias, d_bias)?;
        }
        Ok(())
    }

    /// The table of rotations is known.
    fn passes_to(&self, input: Value) -> bool {
        Some(input) != self.rope
    }
}

/// The gradient of the columns that became heads, with zeros in the others.
fn in_columns(graph: &mut Graph, dx: Value, heads: &SplitHeads) -> Result<Value, GraphError> {
    let (shape, own) = (graph.shape(heads.x).clone(), heads.heads * heads.head_dim);
    let width = shape.width();
    if width == own {
        return Ok(dx);
    }
    let n = |n: usize| u32_of("copy", n);
    let dims = [1, 1, 1, 1, n(shape.rows())?, n(own)?];
    let dst = Strided { offset: heads.offset as u64, strides: [0, 0, 0, 0, n(width)?, 1] };
    graph.in_zeros(shape, vec![(dx, StridedCopy { shape: dims, src: Strided::contiguous(dims), dst })])
}
