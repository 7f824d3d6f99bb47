//! Linear layers and transposed convolutions: input, weights, bias.

use omnix_graph::Shape;
use omnix_graph::ops::Unary;
use omnix_kernels::{Gpu, WeightType};
use omnix_tests::{Trial, as_f16, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "linear",
        tiers: [layers_of_many_sizes, frozen_weights_in_f16],
        device: [
            convolution_kernels_as_layers,
            blocks_of_a_matrix_make_one_gradient,
            a_matrix_used_twice,
            activations_between_layers,
            transposed_convolutions,
        ],
    )
}

fn layers_of_many_sizes(gpu: &Gpu) {
    let sizes =
        [(1, 1, 1, true), (1, 4, 1, false), (5, 7, 3, true), (3, 8, 33, true), (33, 40, 37, false), (70, 5, 64, true)];
    for (m, k, n, biased) in sizes {
        let mut case = Case::new(format!("linear {m} x {k} x {n}"));
        let x = if m % 5 == 0 { case.leaf("x", [5, m / 5, k]) } else { case.leaf("x", [m, k]) };
        let w = case.parameter("w", [n, k]);
        let bias = biased.then(|| case.parameter("b", [n]));
        let y = case.graph.linear(x, w, bias).expect("records");
        case.check(gpu, &[y]);
    }
}

fn convolution_kernels_as_layers(gpu: &Gpu) {
    let mut case = Case::new("patches");
    let x = case.leaf("x", [4, 3 * 2 * 2]);
    let (w, bias) = (case.parameter("w", [6, 3, 2, 2]), case.parameter("b", [6]));
    let y = case.graph.linear(x, w, Some(bias)).expect("records");
    case.check(gpu, &[y]);
}

fn blocks_of_a_matrix_make_one_gradient(gpu: &Gpu) {
    let mut case = Case::new("rows");
    let x = case.leaf("x", [5, 6]);
    case.tensor("w", &Shape::from([9, 6]));
    case.tensor("b", &Shape::from([9]));
    let mut outputs = Vec::new();
    for rows in [0..4, 4..9] {
        let w = case.graph.parameter_rows("w", [9, 6], rows.clone());
        let b = case.graph.parameter_rows("b", [9], rows);
        outputs.push(case.graph.linear(x, w, Some(b)).expect("records"));
    }
    case.check(gpu, &outputs);

    let mut case = Case::new("columns");
    case.tensor("w", &Shape::from([7, 9]));
    let mut outputs = Vec::new();
    for (name, columns) in [("x", 0..2), ("z", 2..9)] {
        let x = case.leaf(name, [4, columns.len()]);
        let w = case.graph.parameter_columns("w", [7, 9], columns);
        outputs.push(case.graph.linear(x, w, None).expect("records"));
    }
    let sum = case.graph.add_values(outputs[0], outputs[1]).expect("adds");
    case.check(gpu, &[sum]);

    // What no layer reads of a tensor has the gradient 0.
    let mut case = Case::new("some of the rows");
    let x = case.leaf("x", [5, 6]);
    case.tensor("w", &Shape::from([9, 6]));
    let w = case.graph.parameter_rows("w", [9, 6], 3..7);
    let y = case.graph.linear(x, w, None).expect("records");
    case.check(gpu, &[y]);
}

fn a_matrix_used_twice(gpu: &Gpu) {
    let mut case = Case::new("twice");
    let x = case.leaf("x", [3, 5]);
    let (w, b) = (case.parameter("w", [5, 5]), case.parameter("b", [5]));
    let y = case.graph.linear(x, w, Some(b)).expect("records");
    let y = case.graph.linear(y, w, Some(b)).expect("records");
    let sum = case.graph.add_values(x, y).expect("adds");
    case.check(gpu, &[sum, y]);
}

/// Forward, the activation is moved into the product; its gradient needs what went into it.
fn activations_between_layers(gpu: &Gpu) {
    for op in [Unary::Gelu, Unary::Silu, Unary::Tanh] {
        let mut case = Case::new(format!("{op:?}"));
        let x = case.leaf("x", [6, 4]);
        let (w, b) = (case.parameter("w", [8, 4]), case.parameter("b", [8]));
        let u = case.parameter("u", [3, 8]);
        let hidden = case.graph.linear(x, w, Some(b)).expect("records");
        let hidden = case.graph.map(op, hidden);
        let y = case.graph.linear(hidden, u, None).expect("records");
        case.check(gpu, &[y]);
    }
}

fn transposed_convolutions(gpu: &Gpu) {
    for (k, channels, out, biased) in
        [(1, 3, 2, true), (2, 1, 1, false), (2, 5, 3, true), (3, 4, 2, true), (4, 8, 33, false)]
    {
        let mut case = Case::new(format!("transposed {k}, {channels} to {out}"));
        let x = case.leaf("x", [2, 2, 3, channels]);
        let w = case.parameter("w", [channels, out, k, k]);
        let bias = biased.then(|| case.parameter("b", [out]));
        let y = case.graph.conv_transpose2d(x, w, bias).expect("records");
        case.check(gpu, &[y]);
    }
}

/// The gradient of an input reads the weights as they are stored.
fn frozen_weights_in_f16(gpu: &Gpu) {
    let mut case = Case::new("f16");
    case.options = case.options.storage(WeightType::F16);
    let x = case.leaf("x", [2, 4, 4, 6]);
    let (w, u, v) = (case.parameter("w", [8, 6]), case.parameter("u", [5, 8, 3, 3]), case.parameter("v", [5, 3, 2, 2]));
    case.data.iter_mut().filter(|(name, _)| *name != "x").for_each(|(_, data)| *data = as_f16(data));
    let y = case.graph.linear(x, w, None).expect("records");
    let y = case.graph.conv2d(y, u, None, 1, 1).expect("records");
    let y = case.graph.conv_transpose2d(y, v, None).expect("records");
    case.check(gpu, &[y]);
}
