//! Values that are computed again instead of kept: as many as a budget takes, at the stated price, and to the bit the same results.

use std::ops::ControlFlow;

use omnix_graph::ops::{AdamW, ReduceOp, Unary};
use omnix_graph::passes::adopt::{gradient_output, parameter_input};
use omnix_graph::plan::memory::Place;
use omnix_graph::{Graph, GraphError, Operation as _, Plan, PlanOptions, Value};
use omnix_kernels::{Caps, Gpu, WeightType, adamw};
use omnix_tests::{gpu, tiers};

use crate::support::{block, feed, numbers, prepare};

/// A loss of six transformer blocks, local and global ones, over 3 images of 40 tokens, with dropout before each; all parameters.
fn network() -> (Graph, Value) {
    let mut g = Graph::new();
    let mut x = g.input("x", [120, 32]);
    let draw = g.input("draw", [1]);
    for index in 0..6 {
        x = g.dropout(x, draw, 0.2, (7, index)).expect("dropout");
        let groups = if index % 2 == 0 { 3 } else { 1 };
        x = block(&mut g, x, groups, (2, 16), &format!("block{index}"));
    }
    let square = g.map(Unary::Square, x);
    let loss = g.reduce_all(square, ReduceOp::Mean).expect("a loss");
    g.output(loss, "loss");
    (g, loss)
}

/// The network with its gradients, its parameters as inputs, and their names.
fn differentiated() -> (Graph, Vec<String>) {
    let (mut g, loss) = network();
    let names = g.gradients(loss, &|_| true).expect("differentiates");
    (g.adopt(&names, WeightType::F32).expect("adopts"), names)
}

fn repeating(budget: u64) -> PlanOptions {
    PlanOptions::default().budget(budget).recompute(true)
}

fn kept(graph: &Graph, caps: &Caps) -> Plan {
    Plan::new(graph, caps, &PlanOptions::default()).expect("plans")
}

/// The least bytes that will do.
fn least(graph: &Graph, caps: &Caps) -> u64 {
    let Err(GraphError::Budget { least, budget: 1 }) = Plan::new(graph, caps, &repeating(1)) else {
        panic!("a byte cannot do")
    };
    least
}

/// All results of `graph` on seeded inputs.
fn results(gpu: &Gpu, graph: &Graph, names: &[String], options: &PlanOptions) -> Vec<Vec<f32>> {
    let executable = prepare(gpu, graph, options);
    feed(&executable, graph);
    // Twice: what a first run left in shared buffers is no part of the second.
    for _ in 0..2 {
        executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
    }
    let outputs = names.iter().map(|name| gradient_output(name)).chain(["loss".to_owned()]);
    outputs.map(|name| executable.read(&name).expect("reads")).collect()
}

#[test]
fn budgets_change_no_bit() {
    let (graph, names) = differentiated();
    for gpu in tiers() {
        let whole = kept(&graph, &gpu.caps);
        let least = least(&graph, &gpu.caps);
        let want = results(&gpu, &graph, &names, &PlanOptions::default());
        let middle = u64::midpoint(least, whole.working_bytes());
        for budget in [whole.working_bytes(), middle, least] {
            let plan = Plan::new(&graph, &gpu.caps, &repeating(budget)).expect("fits");
            assert_eq!(plan.recomputed > 0, budget < whole.working_bytes(), "{budget}");
            assert!(results(&gpu, &graph, &names, &repeating(budget)) == want, "{budget} bytes changed a result");
        }
    }
}

/// What is drawn by a counter differs from step to step, and not between the two times it is computed.
#[test]
fn what_is_drawn_is_drawn_again() {
    let (graph, names) = differentiated();
    let tight = repeating(least(&graph, &gpu().caps));
    let [whole, tight] = [PlanOptions::default(), tight].map(|options| prepare(gpu(), &graph, &options));
    let mut before = Vec::new();
    for step in 1..3 {
        let [want, got] = [&whole, &tight].map(|executable| {
            feed(executable, &graph);
            executable.write_indices("draw", &[step]).expect("writes");
            executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
            names.iter().map(|name| executable.read(&gradient_output(name)).expect("reads")).collect::<Vec<_>>()
        });
        assert!(got == want && want != before, "step {step}");
        before = want;
    }
}

#[test]
fn as_much_as_a_budget_takes_and_no_more() {
    let (graph, _) = differentiated();
    for caps in [Caps::lavapipe(), Caps::baseline()] {
        let whole = kept(&graph, &caps);
        let least = least(&graph, &caps);
        assert!(least * 2 < whole.working_bytes(), "{least} of {}", whole.working_bytes());
        let tightest = Plan::new(&graph, &caps, &repeating(least)).expect("the least works");
        assert_eq!(tightest.working_bytes(), least);
        let mut before = 0;
        for step in 0..=8 {
            let budget = whole.working_bytes() - (whole.working_bytes() - least) * step / 8;
            let plan = Plan::new(&graph, &caps, &repeating(budget)).expect("fits");
            assert!(plan.working_bytes() <= budget, "{} of {budget}", plan.working_bytes());
            assert_eq!(plan.flops(), whole.flops() + plan.recomputed, "the price is what is computed again");
            assert!(plan.recomputed >= before, "{} after {before} for less memory", plan.recomputed);
            assert_eq!(plan.recomputed == 0, step == 0, "{budget}");
            before = plan.recomputed;
        }
        // All of the forward pass a second time is a third of what forward and backward are.
        assert!(before * 2 < whole.flops(), "{before} of {}", whole.flops());
    }
}

/// The first bytes are cheap: norms, moves and functions of single numbers.
#[test]
fn the_cheapest_values_go_first() {
    let (graph, _) = differentiated();
    let caps = Caps::lavapipe();
    let whole = kept(&graph, &caps);
    let budget = whole.working_bytes() / 10 * 9;
    let plan = Plan::new(&graph, &caps, &repeating(budget)).expect("fits");
    assert!(plan.recomputed * 50 < whole.flops(), "{} of {}", plan.recomputed, whole.flops());
}

#[test]
fn values_that_are_alive_together_share_no_buffer() {
    let (graph, _) = differentiated();
    let caps = Caps::lavapipe();
    let plan = Plan::new(&graph, &caps, &repeating(least(&graph, &caps))).expect("fits");
    let nodes = plan.graph.nodes();
    let root = |v: &Value| plan.graph.root(*v);
    // Who wrote what lies in a buffer last: a reader finds the value that it reads.
    let mut holds = vec![None; plan.memory.arena.len()];
    assert_eq!(plan.parts, 1, "nodes run one after the other");
    for node in nodes {
        for value in node.op.inputs().iter().map(root) {
            if let Place::Arena(buffer) = plan.place(value) {
                assert_eq!(holds[buffer], Some(value), "{} reads {}", node.op.name(), plan.graph.value_name(value));
            }
        }
        for value in &node.outputs {
            if let Place::Arena(buffer) = plan.place(*value) {
                holds[buffer] = Some(*value);
            }
        }
    }
}

#[test]
fn graphs_without_a_gradient_are_refused_as_ever() {
    let (graph, _) = network();
    let refused = |options: &PlanOptions| match Plan::new(&graph, &Caps::lavapipe(), options) {
        Err(GraphError::Budget { budget, least }) => (budget, least),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(&repeating(1000)), refused(&PlanOptions::default().budget(1000)));
    let (graph, _) = differentiated();
    let Err(GraphError::Budget { least: without, .. }) =
        Plan::new(&graph, &Caps::lavapipe(), &PlanOptions::default().budget(1000))
    else {
        panic!("not unless it may")
    };
    assert!(least(&graph, &Caps::lavapipe()) < without);
}

/// Weights that a step changes in the same graph: what reads them is not computed again after the change.
#[test]
fn what_changes_in_place_is_not_read_again() {
    let (mut graph, names) = differentiated();
    let rates = graph.input("rates", [4]);
    for name in &names {
        let weights = graph.root(graph.find(&parameter_input(name)).expect("an input"));
        let gradient = graph.find(&gradient_output(name)).expect("an output");
        let shape = graph.shape(weights).clone();
        let [first, second] = ["first", "second"].map(|moment| graph.input(&format!("{moment}.{name}"), shape.clone()));
        let gradient = graph.reshape(gradient, shape).expect("reshapes");
        let state = [weights, first, second];
        let step = AdamW { state, gradient, rates, clip: None, betas: [0.9, 0.99], eps: 1e-8, scale: 1.0 };
        graph.adamw(&step).expect("a step");
    }
    let after = |options: &PlanOptions| {
        let executable = prepare(gpu(), &graph, options);
        feed(&executable, &graph);
        let spec = adamw::AdamW { n: 0, betas: [0.9, 0.99], eps: 1e-8, scale: 1.0, clip: false };
        executable.write("rates", &spec.rates(3, 1e-2, 0.1)).expect("writes");
        for name in &names {
            // Squares are not below zero.
            let squares = format!("second.{name}");
            let count = graph.shape(graph.find(&squares).expect("an input")).elements();
            let values: Vec<f32> = numbers(&squares, count).iter().map(|v| v * v).collect();
            executable.write(&squares, &values).expect("writes");
        }
        executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
        names.iter().map(|name| executable.read(&parameter_input(name)).expect("reads")).collect::<Vec<_>>()
    };
    let tight = repeating(least(&graph, &gpu().caps));
    assert!(after(&tight) == after(&PlanOptions::default()));
}
