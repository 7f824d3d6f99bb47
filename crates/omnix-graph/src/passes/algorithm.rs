//! Which algorithm computes a convolution: the sum over taps, or on some devices and shapes Winograd's
//! (`omnix_kernels::winograd`), which reads other weights and needs scratch memory. Decided once, before memory is
//! planned, and never by the budget: a budget changes no bit of a result.

use omnix_kernels::winograd::Winograd;
use omnix_kernels::{Caps, WeightType};

use crate::graph::{Shape, Source, WeightForm};
use crate::ops::{Graph, Op};

/// Gives convolutions that go by Winograd's algorithm on `caps` their form of weights and, as second output, their scratch.
pub(crate) fn choose(graph: &mut Graph, caps: &Caps, storage: WeightType) {
    for index in 0..graph.nodes.len() {
        let Op::Conv2d(conv) = &graph.nodes[index].op else { continue };
        // Winograd's weights are made by the host, of a checkpoint's.
        if conv.form != WeightForm::Conv || !matches!(graph.info(graph.root(conv.w)).source, Source::Parameter(_)) {
            continue;
        }
        // What is too large for a kernel is said when it is recorded.
        let spec = conv.sum_over_taps(&graph.values, storage);
        let Some(spec) = spec.ok().and_then(|conv| Winograd::of(conv, caps)) else {
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
