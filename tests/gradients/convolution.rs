//! Convolutions: input, weights, bias, for every stride and padding that networks have.

use omnix_graph::ops::Unary;
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::{Case, away_from};

pub(crate) fn trials() -> Vec<Trial> {
    trials!("conv2d", tiers: [kernels_strides_and_paddings], device: [around_a_relu])
}

fn kernels_strides_and_paddings(gpu: &Gpu) {
    // Frames, rows, columns, channels in and out; kernel, stride, padding.
    let cases = [
        ([1, 1, 1, 1, 1], (1, 1, 0), true),
        ([2, 3, 5, 3, 2], (1, 1, 0), false),
        ([1, 4, 3, 2, 5], (3, 1, 1), true),
        ([2, 5, 6, 3, 33], (3, 1, 1), false),
        ([1, 6, 7, 4, 3], (3, 1, 0), true),
        ([1, 5, 5, 2, 2], (5, 1, 2), true),
        ([1, 4, 5, 3, 3], (2, 1, 0), false),
        // A last row and column that no tap of a stride reaches.
        ([2, 6, 7, 3, 4], (3, 2, 1), true),
        ([1, 8, 7, 2, 3], (2, 2, 0), true),
        ([1, 9, 8, 1, 2], (3, 3, 0), false),
        ([1, 7, 5, 2, 2], (1, 2, 0), true),
    ];
    for ([frames, rows, columns, ci, co], (k, stride, padding), biased) in cases {
        let mut case = Case::new(format!("{frames} x {rows} x {columns} x {ci} to {co}, {k}, {stride}, {padding}"));
        let x = case.leaf("x", [frames, rows, columns, ci]);
        let w = case.parameter("w", [co, ci, k, k]);
        let bias = biased.then(|| case.parameter("b", [co]));
        let y = case.graph.conv2d(x, w, bias, stride, padding).expect("records");
        case.check(gpu, &[y]);
    }
}

/// Forward, the ReLU is moved into the convolution that reads it, and the sum into the one that makes it.
fn around_a_relu(gpu: &Gpu) {
    let mut case = Case::new("residual unit");
    let x = case.leaf_of("x", [1, 4, 5, 3], away_from(&[0.0]));
    let (w, b) = (case.parameter("w", [3, 3, 3, 3]), case.parameter("b", [3]));
    let y = case.graph.map(Unary::Relu, x);
    let y = case.graph.conv2d(y, w, Some(b), 1, 1).expect("records");
    let y = case.graph.map(Unary::Gelu, y);
    let u = case.parameter("u", [3, 3, 1, 1]);
    let y = case.graph.conv2d(y, u, None, 1, 0).expect("records");
    let y = case.graph.add_values(x, y).expect("adds");
    case.check(gpu, &[y]);
}
