//! No node reads and writes one buffer; values alive together never share.

use omnix_graph::plan::memory::Place;
use omnix_graph::{Graph, Operation as _, Plan, PlanOptions};
use omnix_kernels::{Caps, WeightType};

use crate::support::two_blocks;

#[test]
fn values_of_one_node_never_share_a_buffer() {
    for parts in [1, 3] {
        let graph = two_blocks(6, 75, (2, 32));
        let plan = Plan::new(&graph, &Caps::baseline(), &PlanOptions::default().parts(parts)).expect("plans");
        for node in plan.graph.nodes() {
            let inputs = node.op.inputs();
            let mut seen: Vec<_> = inputs.iter().chain(&node.outputs).map(|v| plan.graph.root(*v)).collect();
            seen.sort_unstable();
            seen.dedup();
            let buffers: Vec<_> =
                seen.iter().map(|v| plan.place(*v)).filter(|p| matches!(p, Place::Arena(_))).collect();
            let mut distinct = buffers.clone();
            distinct.sort_by_key(|p| format!("{p:?}"));
            distinct.dedup();
            assert_eq!(buffers.len(), distinct.len(), "{}: {buffers:?}", node.op.name());
        }
    }
}

#[test]
fn no_two_values_that_are_alive_together_share_a_buffer() {
    let graphs = [two_blocks(6, 75, (2, 32)), crate::fixed::table(8, 10, false), crate::upload::layers()];
    for (graph, (parts, streamed)) in
        graphs.iter().flat_map(|g| [(1, false), (1, true), (3, false)].map(|how| (g, how)))
    {
        let options = PlanOptions::default().parts(parts).streamed(streamed);
        let plan = Plan::new(graph, &Caps::lavapipe(), &options).expect("plans");
        let nodes = plan.graph.nodes();
        // From the node that makes it to the last that reads it; what is computed once is read by all runs.
        let reads = |v, node: &omnix_graph::Node| node.op.inputs().iter().any(|x| plan.graph.root(*x) == v);
        let life = |i: usize, v| match nodes.iter().rposition(|node| reads(v, node)).unwrap_or(i).max(i) {
            last if i < plan.fixed && last >= plan.fixed => (i, usize::MAX),
            last => (i, last),
        };
        let made = nodes.iter().enumerate().flat_map(|(i, node)| node.outputs.iter().map(move |v| (i, *v)));
        let lives: Vec<_> = made.map(|(i, v)| (plan.place(v), life(i, v))).collect();
        for (n, (place, (from, to))) in lives.iter().enumerate() {
            let Place::Arena(buffer) = place else { continue };
            let meets = |(other, (a, b)): &(Place, (usize, usize))| other == place && a <= to && from <= b;
            assert!(!lives[n + 1..].iter().any(meets), "buffer {buffer} at nodes {from} to {to}, {parts} parts");
        }
    }
}

#[test]
fn a_value_moves_to_another_buffer_to_make_room() {
    use omnix_kernels::resize::{Corners, Filter};

    // Each value lives until the next is made. Largest first, the last two maps take a buffer each and the first goes to one of
    // them; the second meets the first there and a large one in the other, until the first moves.
    let mut g = Graph::new();
    let mut x = g.input("x", [1, 2, 2, 64]);
    for side in [24, 16, 32, 32, 4] {
        x = g.resize(x, side, side, Filter::Bilinear, Corners::HalfPixel).expect("records");
    }
    g.output(x, "y");
    let plan = Plan::new(&g, &Caps::baseline(), &PlanOptions::default()).expect("plans");
    assert_eq!(plan.memory.arena, [32 * 32 * 64 * 4; 2]);
}

#[test]
fn int8_is_for_linear_layers_and_counts_a_byte_a_weight() {
    let mut g = Graph::new();
    let x = g.input("x", [1, 8, 8, 64]);
    let kernel = g.parameter("conv", [64, 64, 3, 3]);
    let x = g.conv2d(x, kernel, None, 1, 1).expect("conv");
    let w = g.parameter("fc", [96, 64]);
    let y = g.linear(x, w, None).expect("fc");
    g.output(y, "y");
    let bytes = |storage| {
        let plan = Plan::new(&g, &Caps::baseline(), &PlanOptions::default().storage(storage)).expect("plans");
        let of = |name: &str| plan.weights.iter().find(|k| &*k.parameter.name == name).map_or(0, |k| k.bytes());
        (of("conv"), of("fc"))
    };
    let (conv, fc) = (64 * 64 * 9, 64 * 96);
    assert_eq!(bytes(WeightType::F32), (4 * conv, 4 * fc));
    assert_eq!(bytes(WeightType::F16), (2 * conv, 2 * fc));
    // A scale of four bytes per column, rounded up to a binding's alignment.
    assert_eq!(bytes(WeightType::I8), (2 * conv, fc + 512));
}
