//! What the pass promises whatever the operation: what has no gradient, what stops one, what passes one on, errors, the same bits.

use omnix_graph::ops::{Binary, Gate, Heads, Motion, ReduceOp, Sampling, Strategy, Trajectory, Unary, Which};
use omnix_graph::passes::adopt::gradient_output;
use omnix_graph::{Graph, GraphError, Value};
use omnix_kernels::Gpu;
use omnix_tests::{Trial, assert_close, family, gpu, trials};

use crate::case::{Case, keep};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "differentiate",
        device: [
            straight_through_values_pass_gradients_on,
            only_what_stands_for_a_value_has_its_gradient,
            detached_values_are_constants,
            several_values_with_given_gradients,
            graphs_that_were_joined,
            two_runs_have_the_same_bits,
        ],
        once: [
            what_the_loss_does_not_depend_on_has_no_gradient,
            choices_stop_gradients,
            an_input_stands_for_an_earlier_value,
            operations_without_a_derivative_are_errors,
            a_rank_may_bound_what_counts,
            a_loss_is_one_number,
            what_kernels_do_not_compute_is_an_error,
            the_loss_may_be_a_leaf,
        ],
    )
}

/// The sum of `value`.
fn sum(graph: &mut Graph, value: Value) -> Value {
    graph.reduce_all(value, ReduceOp::Sum).expect("a sum")
}

fn what_the_loss_does_not_depend_on_has_no_gradient() {
    let mut g = Graph::new();
    let (x, unread, beside) = (g.input("x", [3, 4]), g.input("unread", [4]), g.input("beside", [3, 4]));
    let (w, v) = (g.parameter("w", [2, 4]), g.parameter("v", [2, 4]));
    let y = g.linear(x, w, None).expect("records");
    let z = g.linear(beside, v, None).expect("records");
    g.output(z, "z");
    let loss = sum(&mut g, y);
    let mut graph = g.clone();
    let found = graph.differentiate(loss, &[x, unread, beside, w, v, y]).expect("differentiates");
    let known: Vec<bool> = found.iter().map(Option::is_some).collect();
    assert_eq!(known, [true, false, false, true, false, true]);
    assert_eq!(g.clone().gradients(loss, &|_| true).expect("differentiates"), ["w"]);
    assert!(g.clone().gradients(loss, &|name| name == "v").expect("differentiates").is_empty());
    let nodes = g.nodes().len();
    // Nothing is recorded for what is not wanted: the loss, its parts, and the layer's weights, but not its input.
    g.gradients(loss, &|name| name == "w").expect("differentiates");
    let recorded: Vec<&str> = g.nodes()[nodes..].iter().map(|n| omnix_graph::Operation::name(&n.op)).collect();
    assert!(recorded.contains(&"linear_weights") && !recorded.contains(&"linear"), "{recorded:?}");
}

fn choices_stop_gradients() {
    let mut g = Graph::new();
    let (x, class) = (g.input("x", [2, 5]), g.input("class", [4, 6]));
    let (_, mask) = g.top_k(x, 2).expect("chooses");
    let (order, _, _) = g.reference_view(class, Strategy::SaddleBalanced).expect("chooses");
    let (rows, w) = (g.input("rows", [4, 2]), g.input("w", [2, 5]));
    let ordered = g.gather(rows, order).expect("records");
    let masked = g.zip(Binary::Mul, w, mask).expect("records");
    let (a, b) = (sum(&mut g, ordered), sum(&mut g, masked));
    let loss = g.add_values(a, b).expect("adds");
    let found = g.differentiate(loss, &[x, class, rows, w]).expect("differentiates");
    let known: Vec<bool> = found.iter().map(Option::is_some).collect();
    assert_eq!(known, [false, false, true, true]);
}

/// A mask of the highest scores has the gradient of their probabilities; what it multiplies has the mask as it is.
fn straight_through_values_pass_gradients_on(gpu: &Gpu) {
    let mut case = Case::new("straight-through");
    let scores = case.leaf("scores", [2, 6]);
    let soft = case.graph.map(Unary::Sigmoid, scores);
    let (_, hard) = case.graph.top_k(scores, 3).expect("chooses");
    let mask = case.graph.straight_through(hard, soft).expect("records");
    let mask = case.graph.reshape(mask, [3, 4]).expect("records");
    let (z, w) = (case.leaf("z", [3, 4]), case.parameter("w", [2, 4]));
    let y = case.graph.zip(Binary::Mul, z, mask).expect("records");
    let layer = case.graph.linear(mask, w, None).expect("records");
    let squares = case.graph.map(Unary::Square, mask);
    case.check(gpu, &[y, layer, squares, soft]);
}

/// The value has a derivative of its own, which does not count; what stands for it may stand for another in turn.
fn only_what_stands_for_a_value_has_its_gradient(gpu: &Gpu) {
    let mut case = Case::new("stands for");
    let x = case.leaf("x", [2, 3]);
    let square = case.graph.map(Unary::Square, x);
    let triple = case.graph.map(Unary::ScaleShift { s: 3.0, t: 0.0 }, x);
    let constant = case.graph.constant("constant", [2, 3], vec![5.0; 6]);
    let inner = case.graph.straight_through(constant, triple).expect("records");
    let y = case.graph.straight_through(square, inner).expect("records");
    let y = case.graph.reshape(y, [6]).expect("records");
    // y² with y = x² and dy = 3 dx: 2 x² · 3.
    let y = case.graph.map(Unary::Square, y);
    let loss = case.graph.reduce(y, ReduceOp::Sum, 0).expect("records");
    let (_, got) = case.gradients(gpu, loss).remove(0);
    let want: Vec<f32> = case.data["x"].iter().map(|x| 6.0 * x * x).collect();
    assert_close(&format!("{} ({})", case.name, family(gpu)), &got, &want, 1e-6);
}

fn detached_values_are_constants(gpu: &Gpu) {
    let mut case = Case::new("detached");
    let x = case.leaf("x", [3, 4]);
    let square = case.graph.map(Unary::Square, x);
    let constant = case.graph.detach(square);
    let y = case.graph.zip(Binary::Mul, x, constant).expect("records");
    // Through what stands for another value no gradient passes either, once that is detached.
    let signs = case.graph.map(Unary::Sign, x);
    let signs = case.graph.straight_through(signs, constant).expect("records");
    let z = case.graph.zip(Binary::Mul, x, signs).expect("records");
    let mut graph = case.graph.clone();
    let loss = sum(&mut graph, constant);
    assert!(graph.differentiate(loss, &[x]).expect("differentiates")[0].is_none());
    case.check(gpu, &[y, z]);
}

fn several_values_with_given_gradients(gpu: &Gpu) {
    let mut case = Case::new("given gradients");
    let x = case.leaf("x", [3, 4]);
    let (w, v) = (case.parameter("w", [5, 4]), case.parameter("v", [2, 5]));
    let y = case.graph.linear(x, w, None).expect("records");
    let z = case.graph.linear(y, v, None).expect("records");
    let (dy, dz) = (case.numbers("weights.0", 15), case.numbers("weights.1", 6));
    let mut graph = case.graph.clone();
    let (dy, dz) = (graph.constant("dy", [3, 5], dy), graph.constant("dz", [6], dz));
    let found = graph.differentiate_from(&[(y, dy), (z, dz)], &[x]).expect("differentiates");
    keep(&mut graph, found[0].expect("a gradient"), "gradient.x");
    // The weights of the outputs are the given gradients.
    let loss = case.loss(&[y, z]);
    case.compare("given gradients", loss, "x", &case.run(gpu, &graph).read("gradient.x").expect("reads"));
}

/// A gradient goes on through the input of one graph to the result of the other, straight-through values included.
fn graphs_that_were_joined(gpu: &Gpu) {
    let mut case = Case::new("joined");
    let x = case.leaf("x", [3, 4]);
    let (w, u) = (case.parameter("w", [6, 4]), case.parameter("u", [2, 6]));
    let y = case.graph.linear(x, w, None).expect("records");
    let steps = case.graph.map(Unary::Sign, y);
    let signs = case.graph.straight_through(steps, y).expect("records");
    let (first, second) = (case.graph.input("first", [18]), case.graph.input("second", [3, 6]));
    let square = case.graph.map(Unary::Square, first);
    let z = case.graph.linear(second, u, None).expect("records");
    case.graph.connect(first, y).expect("connects");
    case.graph.connect(second, signs).expect("connects");
    case.check(gpu, &[square, z]);
}

/// Otherwise its nodes would run before those that make the value, and gradients would be lost on their way.
fn an_input_stands_for_an_earlier_value() {
    let mut g = Graph::new();
    let x = g.input("x", [2, 3]);
    let early = g.map(Unary::Square, x);
    let input = g.input("joined", [6]);
    let late = g.map(Unary::Square, x);
    let error = g.connect(input, late).expect_err("a later value").to_string();
    assert!(error.contains("connect") && error.contains("before the input"), "{error}");
    assert!(g.connect(early, x).is_err(), "no input");
    assert!(g.connect(input, input).is_err(), "itself");
    g.connect(input, early).expect("connects");
    assert!(g.connect(input, early).is_err(), "connected already");
}

fn two_runs_have_the_same_bits(gpu: &Gpu) {
    let mut case = Case::new("bits");
    let x = case.leaf("x", [70, 24]);
    let (w, b, u) = (case.parameter("w", [48, 24]), case.parameter("b", [48]), case.parameter("u", [24, 24]));
    let h = case.graph.linear(x, w, Some(b)).expect("records");
    let h = case.graph.swiglu(h).expect("records");
    let h = case.graph.linear(h, u, None).expect("records");
    let h = case.graph.softmax(h);
    let loss = case.loss(&[h]);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    assert_eq!(names, ["b", "u", "w"]);
    let read = || {
        let executable = case.run(gpu, &graph);
        let mut all = Vec::new();
        for name in &names {
            all.push(executable.read(&gradient_output(name)).expect("reads"));
        }
        executable.run(&mut |_, _| std::ops::ControlFlow::Continue(())).expect("runs");
        for (name, before) in names.iter().zip(&all) {
            assert_eq!(&executable.read(&gradient_output(name)).expect("reads"), before, "{name}");
        }
        all
    };
    let first = read();
    assert!(first.iter().flatten().any(|v| *v != 0.0), "gradients are not all 0");
    assert_eq!(first, read(), "{}", family(gpu));
}

const MOTION: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::None };

fn operations_without_a_derivative_are_errors() {
    let mut g = Graph::new();
    let x = g.input("x", [2, 5]);
    let y = g.map(Unary::Square, x);
    let y = g.rank(y, Which::At(1)).expect("records");
    let loss = sum(&mut g, y);
    let error = g.differentiate(loss, &[x]).expect_err("a rank");
    assert!(matches!(error, GraphError::NotDifferentiable { op: "rank" }), "{error}");

    // Training records the two operations that this one is made of.
    let mut g = Graph::new();
    let (offsets, weights, field) = (g.input("o", [4, 2]), g.input("w", [4, 1]), g.input("f", [1, 2, 1, 9]));
    let (mask, points, when) = (g.input("m", [1]), g.input("p", [4, 3]), g.input("when", [2]));
    let sampling = Sampling { offsets, weights, field, mask, pixels: None, image: [2, 2], grid: [1, 1] };
    let (moved, _) = g.trajectory(&Trajectory { sampling, points, when, times: 2, motion: MOTION }).expect("records");
    let loss = sum(&mut g, moved);
    let error = g.clone().differentiate(loss, &[field]).expect_err("a trajectory");
    assert!(matches!(error, GraphError::NotDifferentiable { op: "trajectory" }), "{error}");
    assert!(error.to_string().contains("trajectory"), "{error}");
    // Where no gradient passes it, it may stand.
    let other = g.input("other", [2, 4, 3]);
    let y = g.zip(Binary::Mul, other, moved).expect("records");
    let loss = sum(&mut g, y);
    assert!(g.differentiate(loss, &[other]).expect("differentiates")[0].is_some());
}

/// A quantile of the losses says which of them count: a comparison, which stops the gradient.
fn a_rank_may_bound_what_counts() {
    let mut case = Case::new("quantile");
    let x = case.leaf("x", [1, 9]);
    let losses = case.graph.map(Unary::Square, x);
    let limit = case.graph.rank(losses, Which::Quantile { numerator: 3, denominator: 4 }).expect("records");
    let small = case.graph.zip(Binary::Less, losses, limit).expect("records");
    let y = case.graph.zip(Binary::Keep, losses, small).expect("records");
    let kept = case.graph.reduce(small, ReduceOp::Sum, 1).expect("records");
    let count = case.graph.zip(Binary::Mul, losses, kept).expect("records");
    case.check(gpu(), &[y, count]);
}

fn a_loss_is_one_number() {
    let mut g = Graph::new();
    let x = g.input("x", [2, 1]);
    let error = g.differentiate(x, &[x]).expect_err("two numbers");
    assert!(matches!(error, GraphError::Shape { op: "differentiate", .. }), "{error}");
    assert!(error.to_string().contains("one number"), "{error}");
}

fn what_kernels_do_not_compute_is_an_error() {
    // The input of a convolution whose kernel is not square; its weights have a gradient.
    let mut g = Graph::new();
    let (x, w) = (g.input("x", [1, 5, 5, 2]), g.parameter("w", [3, 2, 1, 3]));
    let y = g.conv2d(x, w, None, 1, 0).expect("records");
    let loss = sum(&mut g, y);
    assert!(g.clone().differentiate(loss, &[w]).expect("differentiates")[0].is_some());
    let error = g.differentiate(loss, &[x]).expect_err("a kernel of 1 x 3");
    assert!(error.to_string().contains("conv2d") && error.to_string().contains("[3, in, k, k]"), "{error}");

    // Heads that two attentions read.
    let mut g = Graph::new();
    let x = g.input("x", [4, 12]);
    let spec = Heads { groups: 1, heads: 1, head_dim: 4, norm: None, rope: None };
    let (q, k) = (g.query_heads(x, 0, &spec).expect("records"), g.key_heads(x, 4, &spec).expect("records"));
    let v = g.value_heads(x, 8, &spec).expect("records");
    let (a, b) = (g.attention(q, k, v).expect("records"), g.attention(q, k, v).expect("records"));
    let y = g.add_values(a, b).expect("adds");
    let loss = sum(&mut g, y);
    let error = g.differentiate(loss, &[x]).expect_err("heads twice");
    assert!(error.to_string().contains("heads that one attention reads"), "{error}");
}

fn the_loss_may_be_a_leaf() {
    let mut case = Case::new("loss");
    let x = case.leaf("x", [1]);
    let y = case.graph.map(Unary::Square, x);
    let mut graph = case.graph.clone();
    let found = graph.differentiate(y, &[y, x]).expect("differentiates");
    for (gradient, name) in found.into_iter().zip(["dy", "dx"]) {
        keep(&mut graph, gradient.expect("a gradient"), name);
    }
    let executable = case.run(gpu(), &graph);
    assert_eq!(executable.read("dy").expect("reads"), [1.0]);
    assert_close("dx", &executable.read("dx").expect("reads"), &[2.0 * case.data["x"][0]], 1e-6);
}
