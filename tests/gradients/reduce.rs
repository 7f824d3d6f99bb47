//! Sums, means, deviations and extremes over axes; softmax.

use omnix_graph::ops::ReduceOp;
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::{Case, keep};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "reduce",
        device: [over_each_axis, over_long_axes, ties_share_an_extreme, what_does_not_deviate_has_no_gradient, softmax],
    )
}

const ALL: [ReduceOp; 5] = [ReduceOp::Sum, ReduceOp::Mean, ReduceOp::Std, ReduceOp::Max, ReduceOp::Min];

/// Numbers of which no two are near each other, in an order that looks random.
fn apart(count: usize) -> Vec<f32> {
    (0..count).map(|i| ((i * 37 + 11) % 101) as f32 / 25.0 - 2.0 + (i / 101) as f32 * 0.011).collect()
}

fn over_each_axis(gpu: &Gpu) {
    for op in ALL {
        let mut case = Case::new(format!("{op:?}"));
        let mut outputs = Vec::new();
        for (name, shape) in
            [("flat", vec![9]), ("matrix", vec![5, 7]), ("map", vec![2, 3, 4]), ("single", vec![3, 1, 2])]
        {
            let x = case.leaf_with(name, shape.as_slice(), apart(shape.iter().product()));
            for axis in 0..shape.len() {
                outputs.push(case.graph.reduce(x, op, axis).expect("records"));
            }
            outputs.push(case.graph.reduce_all(x, op).expect("records"));
        }
        let x = case.leaf_with("neighbours", [3, 2, 4, 2], apart(48));
        outputs.push(case.graph.reduce_axes(x, op, 1..3).expect("records"));
        case.check(gpu, &outputs);
    }
}

/// Axes that are summed in two stages.
fn over_long_axes(gpu: &Gpu) {
    for op in [ReduceOp::Sum, ReduceOp::Mean, ReduceOp::Std] {
        let mut case = Case::new(format!("long {op:?}"));
        let (x, z) = (case.leaf("x", [9000]), case.leaf("z", [3000, 3]));
        let outputs = [case.graph.reduce(x, op, 0).expect("records"), case.graph.reduce(z, op, 0).expect("records")];
        case.check(gpu, &outputs);
    }
}

/// The gradient of one of several equal extremes is a choice: each gets a share, and the shares are the whole.
fn ties_share_an_extreme(gpu: &Gpu) {
    for (op, want) in [(ReduceOp::Max, [0.0, 0.5, 0.5, 0.0]), (ReduceOp::Min, [0.5, 0.0, 0.0, 0.5])] {
        let mut case = Case::new(format!("ties of {op:?}"));
        let x = case.leaf_with("x", [4], vec![-1.0, 2.0, 2.0, -1.0]);
        let y = case.graph.reduce(x, op, 0).expect("records");
        let mut graph = case.graph.clone();
        let dx = graph.differentiate(y, &[x]).expect("differentiates")[0].expect("a gradient");
        keep(&mut graph, dx, "dx");
        assert_eq!(case.run(gpu, &graph).read("dx").expect("reads"), want, "{}", case.name);
    }
}

fn what_does_not_deviate_has_no_gradient(gpu: &Gpu) {
    let mut case = Case::new("no deviation");
    let x = case.leaf_with("x", [2, 3], vec![1.5, 1.5, 1.5, 0.0, 1.0, 2.0]);
    let y = case.graph.reduce(x, ReduceOp::Std, 1).expect("records");
    let sum = case.graph.reduce(y, ReduceOp::Sum, 0).expect("records");
    let mut graph = case.graph.clone();
    let dx = graph.differentiate(sum, &[x]).expect("differentiates")[0].expect("a gradient");
    keep(&mut graph, dx, "dx");
    let dx = case.run(gpu, &graph).read("dx").expect("reads");
    assert_eq!(dx[..3], [0.0; 3], "a row that does not deviate");
    // (x − mean) / (2 · 1).
    for (got, want) in dx[3..].iter().zip([-0.5, 0.0, 0.5]) {
        assert!((got - want).abs() < 1e-6, "{dx:?}");
    }
}

fn softmax(gpu: &Gpu) {
    for shape in [vec![1], vec![7], vec![3, 1], vec![4, 5], vec![2, 3, 33], vec![3, 100]] {
        let mut case = Case::new(format!("softmax {shape:?}"));
        let x = case.leaf_of("x", shape.as_slice(), |v| 2.0 * v);
        let y = case.graph.softmax(x);
        case.check(gpu, &[y]);
    }
}
