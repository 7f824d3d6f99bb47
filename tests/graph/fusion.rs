//! Every fusion rule: the fused graph has fewer nodes and gives the unfused graph's numbers.

use omnix_graph::ops::{Binary, Op, Unary};
use omnix_graph::passes::fuse::fuse;
use omnix_graph::{Graph, Operation as _, PlanOptions};
use omnix_tests::{assert_close, tiers};

use crate::support::{run, two_blocks};

/// Runs `graph` both ways; the fused one has `left` nodes.
fn check(what: &str, graph: &Graph, left: usize) {
    let fused = fuse(graph);
    let names: Vec<_> = fused.nodes().iter().map(|n| n.op.name()).collect();
    assert_eq!(names.len(), left, "{what}: {names:?}");
    for gpu in tiers() {
        let plain = run(&gpu, graph, &PlanOptions::default().fuse(false));
        let fast = run(&gpu, graph, &PlanOptions::default());
        assert_close(&format!("{what}, {}", gpu.caps.tier), &fast, &plain, 1e-6);
    }
}

#[test]
fn activations_join_their_producer() {
    for op in [Unary::Relu, Unary::Gelu, Unary::Silu] {
        let mut g = Graph::new();
        let x = g.input("x", [9, 12]);
        let (w, b) = (g.parameter("w", [20, 12]), g.parameter("b", [20]));
        let y = g.linear(x, w, Some(b)).expect("linear");
        let y = g.map(op, y);
        g.output(y, "y");
        check(&format!("{op:?} after linear"), &g, 1);

        let mut g = Graph::new();
        let x = g.input("x", [1, 5, 6, 8]);
        let (w, b) = (g.parameter("w", [12, 8, 3, 3]), g.parameter("b", [12]));
        let y = g.conv2d(x, w, Some(b), 1, 1).expect("conv");
        let y = g.map(op, y);
        g.output(y, "y");
        check(&format!("{op:?} after conv2d"), &g, 1);
    }
    let mut g = Graph::new();
    let x = g.input("x", [7, 32]);
    let (w, b) = (g.parameter("w", [32]), g.parameter("b", [32]));
    let y = g.layer_norm(x, Some(w), Some(b), 1e-5).expect("norm");
    let y = g.map(Unary::Relu, y);
    g.output(y, "y");
    check("ReLU after layer_norm", &g, 1);
}

#[test]
fn scale_and_residual_join_a_linear_layer() {
    let mut g = Graph::new();
    let x = g.input("x", [33, 16]);
    let other = g.input("other", [33, 24]);
    let (w, b, gamma) = (g.parameter("w", [24, 16]), g.parameter("b", [24]), g.parameter("gamma", [24]));
    let y = g.linear(x, w, Some(b)).expect("linear");
    let y = g.zip(Binary::Mul, y, gamma).expect("scale");
    // The linear layer stands on the right of the sum.
    let y = g.add_values(other, y).expect("sum");
    g.output(y, "y");
    check("layer scale and residual", &g, 1);
}

#[test]
fn a_residual_unit_is_two_convolutions() {
    let mut g = Graph::new();
    let (side, x) = (g.input("side", [2, 6, 5, 8]), g.input("x", [2, 6, 5, 8]));
    let (w1, w2) = (g.parameter("w1", [8, 8, 3, 3]), g.parameter("w2", [8, 8, 3, 3]));
    let (b1, b2) = (g.parameter("b1", [8]), g.parameter("b2", [8]));
    let y = g.map(Unary::Relu, side);
    let y = g.conv2d(y, w1, Some(b1), 1, 1).expect("conv1");
    let y = g.map(Unary::Relu, y);
    let y = g.conv2d(y, w2, Some(b2), 1, 1).expect("conv2");
    let y = g.add_values(side, y).expect("skip");
    let y = g.add_values(x, y).expect("lateral");
    g.output(y, "y");
    check("x + RCU(side)", &g, 2);
}

#[test]
fn a_value_that_is_needed_stays() {
    let mut g = Graph::with_taps(["hidden".to_owned()]);
    let x = g.input("x", [9, 12]);
    let w = g.parameter("w", [20, 12]);
    let hidden = g.linear(x, w, None).expect("linear");
    let hidden = g.name(hidden, "hidden");
    let y = g.map(Unary::Relu, hidden);
    g.output(y, "y");
    check("a tapped value", &g, 2);

    let mut g = Graph::new();
    let x = g.input("x", [9, 12]);
    let w = g.parameter("w", [20, 12]);
    let hidden = g.linear(x, w, None).expect("linear");
    let y = g.map(Unary::Relu, hidden);
    let y = g.add_values(y, hidden).expect("sum");
    g.output(y, "y");
    check("a value read twice", &g, 3);
}

#[test]
fn what_nothing_needs_is_dropped() {
    let mut g = Graph::new();
    let x = g.input("x", [9, 12]);
    let _unused = g.map(Unary::Exp, x);
    let y = g.map(Unary::Square, x);
    g.output(y, "y");
    check("an unused node", &g, 1);
}

#[test]
fn a_transformer_block_has_no_pointwise_nodes_left() {
    let graph = two_blocks(3, 40, (2, 32));
    let fused = fuse(&graph);
    assert!(fused.nodes().iter().all(|n| !matches!(n.op, Op::Map(_) | Op::Zip(_))));
    for gpu in tiers() {
        let plain = run(&gpu, &graph, &PlanOptions::default().fuse(false));
        assert_close("two blocks", &run(&gpu, &graph, &PlanOptions::default()), &plain, 1e-6);
    }
}
