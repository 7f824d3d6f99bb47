//! Layer norm: input, weight, bias.

use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!("layer_norm", tiers: [rows_of_many_widths], device: [a_norm_in_a_residual_branch])
}

/// From three channels on: two that are normalised are 1 and -1, whatever they were, and their gradient is rounding.
fn rows_of_many_widths(gpu: &Gpu) {
    for (shape, weighted, biased) in [
        (vec![1, 3], true, true),
        (vec![3, 7], true, true),
        (vec![2, 3, 32], false, false),
        (vec![5, 33], true, false),
        (vec![4, 96], false, true),
        (vec![65, 100], true, true),
    ] {
        let mut case = Case::new(format!("layer norm {shape:?}"));
        let c = shape[shape.len() - 1];
        let x = case.leaf("x", shape.as_slice());
        let weight = weighted.then(|| case.parameter("w", [c]));
        let bias = biased.then(|| case.parameter("b", [c]));
        let y = case.graph.layer_norm(x, weight, bias, 1e-6).expect("records");
        case.check(gpu, &[y]);
    }
}

fn a_norm_in_a_residual_branch(gpu: &Gpu) {
    let mut case = Case::new("branch");
    let x = case.leaf("x", [5, 12]);
    let (w, b) = (case.parameter("w", [12]), case.parameter("b", [12]));
    let y = case.graph.layer_norm(x, Some(w), Some(b), 1e-5).expect("records");
    let u = case.parameter("u", [12, 12]);
    let y = case.graph.linear(y, u, None).expect("records");
    let y = case.graph.add_values(x, y).expect("adds");
    let y = case.graph.layer_norm(y, Some(w), Some(b), 1e-5).expect("records");
    case.check(gpu, &[y]);
}
