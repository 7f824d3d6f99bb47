//! Which algorithm computes a convolution: the sum over taps, or on some devices and shapes Winograd's
//! (`omnix_kernels::winograd`), which reads other weights and needs scratch memory. Decided once, before memory is
//! planned, and never by the budget: a budget changes no bit of a result.

use omnix_kernels::winograd::Winograd;
use omnix_kernels::{Caps, KernelError, WeightType, conv2d};

use crate::graph::{Graph, Shape, Source};
use crate::op::{Conv2d, Op, WeightForm};
use crate::plan::{packed_shape, stored_as};
use crate::record::too_large;

/// Gives convolutions that go by Winograd's algorithm on `caps` their form of weights and, as second output, their scratch.
pub(crate) fn choose(graph: &mut Graph, caps: &Caps, storage: WeightType) {
    for index in 0..graph.nodes.len() {
        let Op::Conv2d(conv) = &graph.nodes[index].op else { continue };
        // What is too large for a kernel is said when it is recorded.
        let Some(spec) = conv2d_spec(graph, conv, storage).ok().and_then(|conv| Winograd::of(conv, caps)) else {
            continue;
        };
        let name = format!("{}.scratch", graph.value_name(graph.nodes[index].outputs[0]));
        let scratch = graph.add(name, Shape::from([spec.scratch() as usize]), Source::Node(index));
        let node = &mut graph.nodes[index];
        node.outputs.push(scratch);
        if let Op::Conv2d(conv) = &mut node.op {
            conv.form = WeightForm::Winograd;
        }
    }
}

/// The sum over taps that `c` stands for, whatever computes it.
pub(crate) fn conv2d_spec(graph: &Graph, c: &Conv2d, storage: WeightType) -> Result<conv2d::Conv2d, KernelError> {
    let n = |n: usize| u32::try_from(n).map_err(|_| too_large("conv2d", n));
    let (x, w) = (graph.shape(c.x), graph.shape(c.w));
    Ok(conv2d::Conv2d {
        frames: n(x[0])?,
        hi: n(x[1])?,
        wi: n(x[2])?,
        ci: n(x[3])?,
        kernel: [n(w[2])?, n(w[3])?],
        stride: n(c.stride)?,
        padding: n(c.padding)?,
        weights: packed_shape(w, WeightForm::Conv, stored_as(graph, c.w, storage)),
        act: c.act,
        relu_input: c.relu_input,
        bias: c.bias.is_some(),
        residual: c.residuals[0].is_some(),
        residual2: c.residuals[1].is_some(),
    })
}
