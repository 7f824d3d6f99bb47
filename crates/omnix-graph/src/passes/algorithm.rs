//! Which algorithm computes a convolution, or the gradient of its weights: the sum over taps, or on some devices and shapes Winograd's
//! (`omnix_kernels::winograd`), which reads other weights and needs scratch memory. Decided once, before memory is
//! planned, and never by the budget: a budget changes no bit of a result.

use std::collections::BTreeSet;

use omnix_kernels::winograd::Winograd;
use omnix_kernels::winograd_weights::WinogradWeights;
use omnix_kernels::{Caps, WeightType};

use crate::graph::storage::packed_shape;
use crate::graph::{Operation as _, Shape, Source, Value, WeightForm};
use crate::ops::{Graph, Op};

/// Decides for each convolution and each gradient of one's weights.
pub(crate) fn choose(graph: &mut Graph, caps: &Caps, storage: WeightType) {
    convolutions(graph, caps, storage);
    gradients(graph, caps);
}

/// Gives gradients of weights that go by Winograd's algorithm on `caps` the size of sums that it needs and, as last output, scratch for tiles.
fn gradients(graph: &mut Graph, caps: &Caps) {
    for index in 0..graph.nodes.len() {
        let Op::Conv2dWeights(op) = &graph.nodes[index].op else { continue };
        // What is too large for a kernel is said when it is recorded.
        let Some(by_tiles) = op.spec(&graph.values).ok().and_then(|conv| WinogradWeights::of(conv, caps)) else {
            continue;
        };
        let parts = graph.nodes[index].outputs[2];
        graph.info_mut(parts).physical = Shape::from([by_tiles.parts_words() as usize]);
        let name = format!("{}.tiles", graph.value_name(graph.nodes[index].outputs[0]));
        let tiles = graph.add(name, Shape::from([by_tiles.tiles_words() as usize]), Source::Node(index));
        let node = &mut graph.nodes[index];
        node.outputs.push(tiles);
        if let Op::Conv2dWeights(op) = &mut node.op {
            op.winograd = true;
        }
    }
}

/// Gives convolutions that go by Winograd's algorithm on `caps` their form of weights and, as second output, their scratch.
fn convolutions(graph: &mut Graph, caps: &Caps, storage: WeightType) {
    let forms: Vec<_> = (0..graph.nodes.len()).map(|index| form(graph, index, caps, storage)).collect();
    // Weights that a node packs are packed once: all that read them go by one algorithm, or the sum over taps.
    let mut by_taps = BTreeSet::new();
    for (node, form) in graph.nodes.iter().zip(&forms) {
        if form.is_none() {
            by_taps.extend(node.op.inputs().into_iter().map(|value| graph.root(value)));
        }
    }
    for (index, form) in forms.into_iter().enumerate() {
        let Some((form, scratch)) = form else { continue };
        let Op::Conv2d(conv) = &graph.nodes[index].op else { continue };
        let weights = graph.root(conv.w);
        if let Source::Node(packed) = graph.info(weights).source {
            if by_taps.contains(&weights) {
                continue;
            }
            pack_as(graph, packed, weights, form);
        }
        let name = format!("{}.scratch", graph.value_name(graph.nodes[index].outputs[0]));
        let scratch = graph.add(name, Shape::from([scratch as usize]), Source::Node(index));
        let node = &mut graph.nodes[index];
        node.outputs.push(scratch);
        if let Op::Conv2d(conv) = &mut node.op {
            conv.form = form;
        }
    }
}

/// The form in which a node reads its weights if it goes by Winograd's algorithm, and the words of its scratch.
fn form(graph: &Graph, index: usize, caps: &Caps, storage: WeightType) -> Option<(WeightForm, u64)> {
    let Op::Conv2d(conv) = &graph.nodes[index].op else { return None };
    let form = conv.form.by_winograd()?;
    // The host makes weights of a checkpoint's, a node those of a tensor that is trained.
    let made = match graph.info(graph.root(conv.w)).source {
        Source::Parameter(_) => true,
        Source::Node(node) => matches!(graph.nodes[node].op, Op::Pack(_)),
        _ => false,
    };
    if !made {
        return None;
    }
    // What is too large for a kernel is said when it is recorded.
    let spec = conv.sum_over_taps(&graph.values, storage).ok()?;
    Some((form, Winograd::of(spec, caps)?.scratch()))
}

/// Has the node at `index` pack `weights` in this form.
fn pack_as(graph: &mut Graph, index: usize, weights: Value, form: WeightForm) {
    let Op::Pack(pack) = &mut graph.nodes[index].op else { return };
    pack.form = form;
    let words = packed_shape(&pack.block.shape(), form, pack.storage).bytes() as usize / 4;
    graph.info_mut(weights).physical = Shape::from([words]);
}
