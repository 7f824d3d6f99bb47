//! Functions of one number and of two, for every kind of second operand, and the choice between two.

use omnix_graph::ops::{Binary, Unary};
use omnix_kernels::Gpu;
use omnix_tests::{Trial, trials};

use crate::case::{Case, away_from};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "pointwise",
        device: [
            functions_of_one_number,
            powers,
            steps_are_constants,
            functions_of_two_numbers,
            a_value_with_itself,
            masks_keep_what_is_not_a_number_out,
            choices_between_two,
        ],
    )
}

/// Away from 0, its sign kept.
fn not_small(v: f32) -> f32 {
    v.signum() * (0.3 + v.abs())
}

fn functions_of_one_number(gpu: &Gpu) {
    let any: &dyn Fn(f32) -> f32 = &|v| v;
    let positive = |v: f32| 0.1 + v.abs();
    // Beyond 20 the identity.
    let far = |v: f32| 12.0 * v;
    let (zero, bounds) = (away_from(&[0.0]), away_from(&[-0.5, 0.8]));
    let functions: [(Unary, &dyn Fn(f32) -> f32); 16] = [
        (Unary::Relu, &zero),
        (Unary::Neg, any),
        (Unary::Abs, &zero),
        (Unary::Square, any),
        (Unary::Reciprocal, &not_small),
        (Unary::ScaleShift { s: -1.7, t: 0.3 }, any),
        (Unary::Clamp { low: -0.5, high: 0.8 }, &bounds),
        (Unary::Sqrt, &positive),
        (Unary::Gelu, any),
        (Unary::Silu, any),
        (Unary::Sigmoid, any),
        (Unary::Softplus, &far),
        (Unary::Exp, any),
        (Unary::Log, &positive),
        (Unary::ExpClamped { low: -0.5, high: 0.8 }, &bounds),
        (Unary::Tanh, any),
    ];
    for (op, domain) in functions {
        let mut case = Case::new(format!("{op:?}"));
        let shapes: [(&str, &[usize]); 3] = [("one", &[1]), ("odd", &[5, 7]), ("four", &[2, 3, 8])];
        let outputs = shapes.map(|(name, shape)| {
            let x = case.leaf_of(name, shape, domain);
            case.graph.map(op, x)
        });
        case.check(gpu, &outputs);
    }
}

fn powers(gpu: &Gpu) {
    for (exponent, negative) in
        [(1.0, true), (2.0, true), (3.0, true), (-1.0, true), (0.5, false), (2.5, false), (-1.5, false)]
    {
        let mut case = Case::new(format!("power {exponent}"));
        let x = case.leaf_of("x", [5, 7], |v| if negative { not_small(v) } else { not_small(v).abs() });
        let y = case.graph.map(Unary::Power { exponent }, x);
        case.check(gpu, &[y]);
    }
}

/// What changes in steps is a constant to the gradient, not an obstacle.
fn steps_are_constants(gpu: &Gpu) {
    for op in [Unary::Sign, Unary::IsFinite, Unary::Below { limit: 0.25 }] {
        let mut case = Case::new(format!("{op:?}"));
        let x = case.leaf_of("x", [4, 6], away_from(&[0.0, 0.25]));
        let step = case.graph.map(op, x);
        let y = case.graph.zip(Binary::Mul, x, step).expect("records");
        case.check(gpu, &[y]);
    }
    for op in [Binary::Equal, Binary::Less] {
        let mut case = Case::new(format!("{op:?}"));
        let (a, b) = (case.leaf_of("a", [4, 6], quarters), case.leaf_of("b", [6], between_quarters));
        let step = case.graph.zip(op, a, b).expect("records");
        let y = case.graph.zip(Binary::Sub, a, b).expect("records");
        let y = case.graph.zip(Binary::Mul, y, step).expect("records");
        case.check(gpu, &[y, a]);
    }
}

/// Multiples of 1/4, none of which is near one of [`between_quarters`].
fn quarters(v: f32) -> f32 {
    (v * 4.0).round() / 4.0
}

fn between_quarters(v: f32) -> f32 {
    quarters(v) + 0.125
}

fn functions_of_two_numbers(gpu: &Gpu) {
    for op in [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Max, Binary::Min] {
        let mut case = Case::new(format!("{op:?}"));
        let kinds: [(&str, &[usize], &[usize]); 7] = [
            ("alike", &[3, 5], &[3, 5]),
            ("row", &[4, 6], &[6]),
            ("table", &[2, 3, 5], &[3, 5]),
            ("number", &[4, 3], &[1]),
            ("scalar", &[7], &[]),
            ("two scalars", &[], &[]),
            ("one row", &[1, 8], &[8]),
        ];
        let mut outputs = Vec::new();
        for (kind, left, right) in kinds {
            let a = case.leaf_of(&format!("{kind}, left"), left, quarters);
            let b = case.leaf_of(&format!("{kind}, right"), right, between_quarters);
            outputs.push(case.graph.zip(op, a, b).expect("records"));
        }
        let shapes: [(&str, &[usize], &[usize]); 3] =
            [("rows", &[5, 4], &[5]), ("rows of a map", &[2, 3, 4], &[2, 3, 1]), ("one column", &[3, 1], &[3])];
        for (kind, left, right) in shapes {
            let a = case.leaf_of(&format!("{kind}, left"), left, quarters);
            let b = case.leaf_of(&format!("{kind}, right"), right, between_quarters);
            outputs.push(case.graph.zip_rows(op, a, b).expect("records"));
        }
        case.check(gpu, &outputs);
    }
}

fn a_value_with_itself(gpu: &Gpu) {
    for op in [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div] {
        let mut case = Case::new(format!("{op:?} itself"));
        let x = case.leaf_of("x", [4, 3], not_small);
        let y = case.graph.zip(op, x, x).expect("records");
        // Under another shape too, and once more after that.
        let turned = case.graph.reshape(x, [2, 6]).expect("records");
        let row = case.graph.slice(turned, 0, 0, 1).expect("records");
        let row = case.graph.reshape(row, [6]).expect("records");
        let z = case.graph.zip(op, turned, row).expect("records");
        let sum = case.graph.add_values(x, y).expect("records");
        case.check(gpu, &[y, z, sum]);
    }
}

/// A product with a mask of 0 would make NaN of it, forward and backward.
fn masks_keep_what_is_not_a_number_out(gpu: &Gpu) {
    for op in [Binary::Keep, Binary::Drop] {
        let mut case = Case::new(format!("{op:?}"));
        let bits = [1.0, 0.0, 0.0, 2.0, 0.0, -1.0];
        let out = |i: usize| (bits[i] == 0.0) == (op == Binary::Keep);
        let mask = case.given("mask", [6], bits.to_vec());
        let numbers = case.numbers("x", 24);
        let data = numbers.iter().enumerate().map(|(i, v)| if out(i % 6) { f32::NAN } else { *v }).collect();
        let x = case.leaf_with("x", [4, 6], data);
        let y = case.graph.zip(op, x, mask).expect("records");
        let y = case.graph.map(Unary::Exp, y);
        let rows = case.given("row mask", [4], vec![0.0, 1.0, 1.0, 0.0]);
        let z = case.leaf("z", [4, 5]);
        let z = case.graph.zip_rows(op, z, rows).expect("records");
        case.check(gpu, &[y, z]);
    }
}

fn choices_between_two(gpu: &Gpu) {
    for (name, mask, shape) in [
        ("elements", vec![0.0, 1.0, 0.0, -2.0, 1.0, 0.0, 0.0, 3.0, f32::NAN, 1.0, 0.0, 0.0], [3, 4]),
        ("rows", vec![0.0, 1.0, -3.0, 0.0, 0.0], [5, 3]),
    ] {
        let mut case = Case::new(format!("select {name}"));
        let per = shape[0] * shape[1] / mask.len();
        let chosen: Vec<bool> = (0..shape[0] * shape[1]).map(|i| mask[i / per] != 0.0).collect();
        // What is not chosen is no number.
        let side = |case: &Case, leaf: &str, taken: bool| {
            let numbers = case.numbers(leaf, chosen.len());
            let number = |(v, c): (f32, &bool)| if *c == taken { v } else { f32::NAN };
            numbers.into_iter().zip(&chosen).map(number).collect::<Vec<f32>>()
        };
        let (a, b) = (side(&case, "a", true), side(&case, "b", false));
        let (a, b) = (case.leaf_with("a", shape, a), case.leaf_with("b", shape, b));
        let shape: &[usize] = if per == 1 { &shape } else { &[shape[0]] };
        let mask = case.given("mask", shape, mask);
        let y = case.graph.select(mask, a, b).expect("records");
        let y = case.graph.map(Unary::Square, y);
        case.check(gpu, &[y]);
    }
}
