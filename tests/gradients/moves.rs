//! What moves numbers: permutations, slices, joins, repeats, blocks in zeros, reshapes; values that are used more than once.

use omnix_graph::ops::{Binary, Op, Piece, Strided, StridedCopy, Unary};
use omnix_graph::{Plan, PlanOptions};
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "moves",
        device: [permutations, slices_and_joins, repeats, assembled_blocks, windows_that_overlap, blocks_in_zeros, values_used_more_than_once, slices_go_back_together],
    )
}

fn permutations(gpu: &Gpu) {
    let mut case = Case::new("permute");
    let mut outputs = Vec::new();
    for (name, shape, order) in [
        ("matrix", vec![3, 5], vec![1, 0]),
        ("map", vec![2, 3, 4], vec![2, 0, 1]),
        ("same", vec![2, 3], vec![0, 1]),
        ("ones", vec![1, 4, 1, 2], vec![3, 2, 0, 1]),
        ("six", vec![2, 1, 3, 2, 1, 2], vec![5, 3, 1, 0, 2, 4]),
    ] {
        let x = case.leaf(name, shape.as_slice());
        outputs.push(case.graph.permute(x, &order).expect("records"));
    }
    case.check(gpu, &outputs);
}

fn slices_and_joins(gpu: &Gpu) {
    let mut case = Case::new("slice and concat");
    let (x, z) = (case.leaf("x", [3, 5, 2]), case.leaf("z", [3, 1, 2]));
    let whole = case.graph.slice(x, 0, 0, 3).expect("records");
    let rows = case.graph.slice(x, 0, 1, 2).expect("records");
    let middle = case.graph.slice(x, 1, 2, 2).expect("records");
    let overlapping = case.graph.slice(x, 1, 3, 2).expect("records");
    let last = case.graph.slice(x, 2, 1, 1).expect("records");
    let joined = case.graph.concat(&[middle, z, overlapping, z], 1).expect("records");
    let stacked = case.graph.concat(&[rows, x], 0).expect("records");
    case.check(gpu, &[whole, rows, joined, last, stacked]);
}

fn repeats(gpu: &Gpu) {
    let mut case = Case::new("repeat");
    let (x, z, one) = (case.leaf("x", [2, 3]), case.leaf("z", [4]), case.leaf("one", [1]));
    let outputs = [(x, 4), (z, 1), (one, 5)].map(|(value, count)| case.graph.repeat(value, count).expect("records"));
    let again = case.graph.repeat(outputs[0], 3).expect("records");
    case.check(gpu, &[outputs[0], outputs[1], outputs[2], again]);
}

/// Blocks of two values, one repeated along two axes.
fn assembled_blocks(gpu: &Gpu) {
    let mut case = Case::new("assemble");
    let (x, z) = (case.leaf("x", [3, 4]), case.leaf("z", [2, 3]));
    let pieces = [
        Piece { value: x, dims: vec![2, 3, 2], start: 1, strides: vec![0, 4, 1], at: vec![0, 0, 0] },
        Piece { value: x, dims: vec![2, 3, 1], start: 3, strides: vec![0, 4, 1], at: vec![0, 0, 2] },
        Piece { value: z, dims: vec![2, 3, 3], start: 0, strides: vec![3, 0, 1], at: vec![0, 0, 3] },
        Piece { value: z, dims: vec![2, 3, 1], start: 5, strides: vec![0, 0, 1], at: vec![0, 0, 6] },
        Piece { value: x, dims: vec![2, 3, 0], start: 0, strides: vec![0, 4, 1], at: vec![0, 0, 7] },
    ];
    let y = case.graph.assemble([2, 3, 7], &pieces).expect("records");
    case.check(gpu, &[y]);
}

/// A number that several windows read gets a part of its gradient from each.
fn windows_that_overlap(gpu: &Gpu) {
    let mut case = Case::new("windows");
    let (x, z) = (case.leaf("x", [7]), case.leaf("z", [4, 5]));
    let rows = Piece { value: x, dims: vec![4, 3], start: 1, strides: vec![1, 1], at: vec![0, 0] };
    let windows = case.graph.assemble([4, 3], &[rows]).expect("records");
    // Windows of 3 x 2 pixels, one of whose axes is repeated.
    let pixels = Piece { value: z, dims: vec![2, 4, 2, 3, 2], start: 0, strides: vec![5, 1, 0, 5, 1], at: vec![0; 5] };
    let patches = case.graph.assemble([2, 4, 2, 3, 2], &[pixels]).expect("records");
    // The diagonal and what lies beside it.
    let band = Piece { value: z, dims: vec![2, 3], start: 1, strides: vec![6, 5], at: vec![0, 0] };
    let band = case.graph.assemble([2, 3], &[band]).expect("records");
    case.check(gpu, &[windows, patches, band]);
}

fn blocks_in_zeros(gpu: &Gpu) {
    let mut case = Case::new("in zeros");
    let (x, z) = (case.leaf("x", [2, 3]), case.leaf("z", [4]));
    let spread = StridedCopy {
        shape: [1, 1, 1, 1, 2, 3],
        src: Strided { offset: 0, strides: [0, 0, 0, 0, 3, 1] },
        dst: Strided { offset: 1, strides: [0, 0, 0, 0, 10, 2] },
    };
    // Two numbers, three times each.
    let repeated = StridedCopy {
        shape: [1, 1, 1, 1, 3, 2],
        src: Strided { offset: 1, strides: [0, 0, 0, 0, 0, 2] },
        dst: Strided { offset: 20, strides: [0, 0, 0, 0, 2, 1] },
    };
    let y = case.graph.in_zeros([3, 10], vec![(x, spread), (z, repeated)]).expect("records");
    case.check(gpu, &[y, z]);
}

fn values_used_more_than_once(gpu: &Gpu) {
    let mut case = Case::new("used often");
    let x = case.leaf("x", [4, 6]);
    let turned = case.graph.permute(x, &[1, 0]).expect("records");
    let flat = case.graph.reshape(x, [24]).expect("records");
    let squares = case.graph.map(Unary::Square, flat);
    let map = case.graph.reshape(squares, [2, 2, 6]).expect("records");
    let half = case.graph.slice(map, 0, 1, 1).expect("records");
    let half = case.graph.reshape(half, [2, 6]).expect("records");
    let row = case.graph.slice(x, 0, 2, 1).expect("records");
    let row = case.graph.reshape(row, [6]).expect("records");
    let product = case.graph.zip(Binary::Mul, x, row).expect("records");
    let product = case.graph.zip(Binary::Mul, product, x).expect("records");
    case.check(gpu, &[turned, half, product, x]);
}

/// Slices that do not meet have one gradient, which is written once.
fn slices_go_back_together(gpu: &Gpu) {
    for axis in [0, 1, 2] {
        let mut case = Case::new(format!("slices along axis {axis}"));
        let x = case.leaf("x", [4, 8, 12]);
        let mut outputs = Vec::new();
        // All of the axis but its last quarter; the slope is not the same everywhere.
        let step = [4, 8, 12][axis] / 4;
        for part in 0..3 {
            let slice = case.graph.slice(x, axis, part * step, step).expect("records");
            outputs.push(case.graph.map(Unary::Square, slice));
        }
        let mut graph = case.graph.clone();
        let ones = outputs.iter().map(|y| {
            let shape = graph.shape(*y).clone();
            let ones = vec![1.0; shape.elements()];
            (*y, graph.constant("one", shape, ones))
        });
        let given: Vec<_> = ones.collect();
        let gradient = graph.differentiate_from(&given, &[x]).expect("differentiates")[0].expect("a gradient");
        graph.output(gradient, "gradient");
        let plan = Plan::new(&graph, &gpu.caps, &PlanOptions::default()).expect("plans");
        let zeros = plan.graph.nodes().iter().filter(|node| matches!(&node.op, Op::Copies(copies) if copies.zeros));
        assert_eq!(zeros.count(), 1, "{}", case.name);
        case.check(gpu, &outputs);
    }
}
