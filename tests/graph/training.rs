//! The operations that training records, each with its arguments in their places and its scratch: against the oracles of the kernels.

use std::ops::ControlFlow;

use omnix_graph::ops::{AdamW, Binary, Expand, Gate, Motion, ReduceOp, Sampling, Strided, StridedCopy, Unary, Which};
use omnix_graph::{Graph, PlanOptions, Value};
use omnix_kernels::{Gpu, cpu};
use omnix_tests::{assert_close, relative_error, tiers};

use crate::support::{feed, numbers, prepare};

/// Runs `g` on seeded inputs; the outputs of these names.
fn outputs<const N: usize>(gpu: &Gpu, g: &Graph, names: [&str; N]) -> [Vec<f32>; N] {
    let executable = prepare(gpu, g, &PlanOptions::default());
    feed(&executable, g);
    // Twice: what a first run left in scratch is no part of the second.
    for _ in 0..2 {
        executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
    }
    names.map(|name| executable.read(name).expect("reads"))
}

/// u32 numbers as a constant.
fn indices(g: &mut Graph, name: &str, shape: &[usize], values: &[u32]) -> Value {
    g.constant(name, shape, values.iter().map(|v| f32::from_bits(*v)).collect())
}

fn narrow(values: impl IntoIterator<Item = f64>) -> Vec<f32> {
    values.into_iter().map(|v| v as f32).collect()
}

#[test]
fn a_slice_goes_back_into_zeros() {
    let mut g = Graph::new();
    let (a, b) = (g.input("a", [2, 3]), g.input("b", [2, 2]));
    let piece = |shape: [u32; 2], first: u64, step: u32| StridedCopy {
        shape: [1, 1, 1, 1, shape[0], shape[1]],
        src: Strided { offset: 0, strides: [0, 0, 0, 0, shape[1], 1] },
        dst: Strided { offset: first, strides: [0, 0, 0, 0, 10, step] },
    };
    // Every third number from the first, two neighbours from the seventh.
    let y = g.in_zeros([2, 10], vec![(a, piece([2, 3], 0, 3)), (b, piece([2, 2], 7, 1))]).expect("fits");
    let ones = g.fill([2, 10], 1.0);
    let y = g.add_values(y, ones).expect("adds");
    g.output(y, "y");
    let (a_in, b_in) = (numbers("a", 6), numbers("b", 4));
    let mut want = vec![1.0; 20];
    for r in 0..2 {
        (0..3).for_each(|i| want[r * 10 + i * 3] += a_in[r * 3 + i]);
        (0..2).for_each(|i| want[r * 10 + 7 + i] += b_in[r * 2 + i]);
    }
    for gpu in tiers() {
        assert_eq!(outputs(&gpu, &g, ["y"]), [want.clone()]);
    }
    assert!(g.in_zeros([2, 9], vec![(a, piece([2, 3], 0, 3)), (b, piece([2, 2], 7, 1))]).is_err(), "leaves the result");
    assert!(g.in_zeros([2, 10], vec![(b, piece([2, 3], 0, 3))]).is_err(), "reads outside of its value");
    assert!(g.in_zeros([2, 10], vec![(a, piece([2, 3], 0, 0))]).is_err(), "writes an element three times");
}

#[test]
fn integers_fill_too() {
    let mut g = Graph::new();
    let rows = g.input("rows", [4, 3]);
    let index = g.fill_u32([2], 3);
    let y = g.gather(rows, index).expect("gathers");
    g.output(y, "y");
    let last = numbers("rows", 12)[9..].to_vec();
    for gpu in tiers() {
        assert_eq!(outputs(&gpu, &g, ["y"]), [[last.clone(), last.clone()].concat()]);
    }
}

#[test]
fn slopes_and_choices_take_their_arguments_in_order() {
    let mut g = Graph::new();
    let (x, dy) = (g.input("x", [6, 8]), g.input("dy", [6, 8]));
    let slope = g.map_grad(Unary::Gelu, x, dy).expect("slope");
    g.output(slope, "slope");
    let row = g.slice(x, 1, 0, 1).expect("a column");
    let mask = g.map(Unary::Below { limit: 0.0 }, row);
    let chosen = g.select(mask, x, dy).expect("chosen");
    g.output(chosen, "chosen");
    let kept = g.zip(Binary::Keep, x, dy).expect("kept");
    g.output(kept, "kept");
    let (x_in, dy_in) = (numbers("x", 48), numbers("dy", 48));
    let pairs = || x_in.iter().zip(&dy_in).map(|(x, dy)| (f64::from(*x), f64::from(*dy)));
    let slopes = narrow(pairs().map(|(x, dy)| dy * cpu::unary_slope(Unary::Gelu, x)));
    let choices: Vec<f32> = (0..48).map(|i| if x_in[i / 8 * 8] < 0.0 { x_in[i] } else { dy_in[i] }).collect();
    for gpu in tiers() {
        let [slope, chosen, kept] = outputs(&gpu, &g, ["slope", "chosen", "kept"]);
        assert_close("slope", &slope, &slopes, 2e-6);
        assert!(chosen == choices && kept == x_in);
    }
    let other = g.input("other", [6, 7]);
    assert!(g.map_grad(Unary::Exp, x, other).is_err() && g.select(other, x, dy).is_err());
    assert!(g.select(mask, x, other).is_err());
}

#[test]
fn long_axes_and_whole_values_reduce() {
    let mut g = Graph::new();
    let x = g.input("x", [3, 1500, 4]);
    let all = g.reduce_all(x, ReduceOp::Mean).expect("all");
    let columns = g.reduce_axes(x, ReduceOp::Sum, 0..2).expect("columns");
    let middle = g.reduce(x, ReduceOp::Max, 1).expect("middle");
    assert!(g.shape(all).is_empty() && **g.shape(columns) == [4] && **g.shape(middle) == [3, 4]);
    for (value, name) in [(all, "all"), (columns, "columns"), (middle, "middle")] {
        g.output(value, name);
    }
    let input = numbers("x", 18_000);
    for gpu in tiers() {
        let [all, columns, middle] = outputs(&gpu, &g, ["all", "columns", "middle"]);
        assert_close("all", &all, &cpu::reduce((1, 18_000, 1), ReduceOp::Mean, &input), 1e-5);
        assert_close("columns", &columns, &cpu::reduce((1, 4500, 4), ReduceOp::Sum, &input), 1e-5);
        assert_eq!(middle, cpu::reduce((3, 1500, 4), ReduceOp::Max, &input));
    }
    assert!(g.reduce_axes(x, ReduceOp::Sum, 1..4).is_err());
}

#[test]
fn gates_and_expansions_have_gradients() {
    let mut g = Graph::new();
    let (x, dy) = (g.input("x", [5, 24]), g.input("dy", [5, 12]));
    let dx = g.swiglu_grad(x, dy).expect("swiglu");
    g.output(dx, "dx");
    let (q, shift, kappa) = (g.input("q", [7, 6]), g.input("shift", [3, 6]), g.input("kappa", [7, 1]));
    let dz = g.input("dz", [3, 7, 6]);
    let parts = Expand { kappa: Some(kappa), ..Expand::default() };
    let grad = g.token_expand_grad(q, shift, parts, dz).expect("expand");
    for (value, name) in [(grad.q, "dq"), (grad.rows, "rows"), (grad.times, "times")] {
        g.output(value, name);
    }
    let spec = omnix_kernels::token_expand_grad::TokenExpandGrad {
        m: 7,
        d: 6,
        times: 3,
        scale: false,
        alpha: false,
        kappa: true,
    };
    let [q, shift, kappa] = [numbers("q", 42), numbers("shift", 18), numbers("kappa", 7)];
    let (dq, rows, times) = cpu::token_expand_grad(&spec, [&q, &[], &shift, &[], &kappa, &numbers("dz", 126)]);
    let dx = cpu::swiglu_grad((5, 12), &numbers("x", 120), &numbers("dy", 60));
    for gpu in tiers() {
        let got = outputs(&gpu, &g, ["dx", "dq", "rows", "times"]);
        for (got, want) in got.iter().zip([&dx, &dq, &rows, &times]) {
            assert!(relative_error(got, want) < 2e-6, "{}", gpu.caps.tier);
        }
    }
    let other = g.input("other", [3, 7]);
    assert!(g.swiglu_grad(x, x).is_err() && g.token_expand_grad(dy, other, parts, dz).is_err());
}

const IMAGE: [usize; 2] = [6, 7];
const GRID: [usize; 2] = [2, 3];
const TIMES: usize = 2;
const PIXELS: usize = IMAGE[0] * IMAGE[1];

#[test]
fn sampled_fields_and_moved_points_have_gradients() {
    let mut g = Graph::new();
    let cells = GRID[0] * GRID[1];
    let field = g.input("field", [2, TIMES, cells, 9]);
    let mask = g.input("mask", [cells]);
    let (offsets, weights) = (g.input("offsets", [PIXELS, 12]), g.input("weights", [PIXELS, 6]));
    let dtau = g.input("dtau", [PIXELS, TIMES * 9 + 1]);
    let sampling = Sampling { offsets, weights, field, mask, pixels: None, image: IMAGE, grid: GRID };
    let (doffsets, dweights) = g.deform_sample_grad(&sampling, dtau).expect("where");
    let (dfield, dmask) = g.deform_sample_grad_field(&sampling, dtau).expect("what");
    let index = indices(&mut g, "index", &[2, 2], &[1, 4, 0, 5]);
    let dz = g.field_scatter_grad(dfield, index).expect("tokens");
    let when = indices(&mut g, "when", &[1], &[1]);
    let (points, dy) = (g.input("points", [PIXELS, 3]), g.input("dy", [TIMES, PIXELS, 3]));
    let dscore = g.input("dscore", [PIXELS]);
    let motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.5) };
    let tau = g.input("tau", [PIXELS, TIMES * 9 + 1]);
    let (to_tau, to_points) = g.traj_apply_grad((tau, points, when), motion, dy, Some(dscore)).expect("moved");
    let named = [
        (doffsets, "doffsets"),
        (dweights, "dweights"),
        (dfield, "dfield"),
        (dmask, "dmask"),
        (dz, "dz"),
        (to_tau, "to_tau"),
        (to_points, "to_points"),
    ];
    for (value, name) in named {
        g.output(value, name);
    }
    let n = |name: &str, value: Value| numbers(name, g.shape(value).elements());
    let (field, mask) = (n("field", field), n("mask", mask));
    let (offsets, weights) = (n("offsets", offsets), n("weights", weights));
    let data = cpu::Sampled { offsets: &offsets, weights: &weights, pixels: &[], field: &field, mask: &mask };
    let spec = omnix_kernels::deform_sample::DeformSample {
        n: PIXELS as u32,
        width: IMAGE[1] as u32,
        height: IMAGE[0] as u32,
        hp: GRID[0] as u32,
        wp: GRID[1] as u32,
        levels: 2,
        points: 3,
        times: TIMES as u32,
        listed: false,
    };
    let sampled = cpu::deform_sample_grad(&spec, &data, &n("dtau", dtau));
    let scatter = omnix_kernels::field_scatter_grad::FieldScatterGrad {
        sources: 2,
        times: TIMES as u32,
        k: 2,
        cells: cells as u32,
        c: 9,
    };
    let dz = cpu::field_scatter_grad(&scatter, &sampled.field, &[1, 4, 0, 5]);
    let apply =
        omnix_kernels::traj_apply_grad::TrajApplyGrad { n: PIXELS as u32, times: TIMES as u32, motion, theta: true };
    let inputs = [n("tau", tau), n("points", points), n("dy", dy), n("dscore", dscore)];
    let (to_tau, to_points) = cpu::traj_apply_grad(&apply, [0, 1, 2, 3].map(|i| inputs[i].as_slice()), 1);
    let want = [sampled.offsets, sampled.weights, sampled.field, sampled.mask, dz, to_tau, to_points];
    for gpu in tiers() {
        let got = outputs(&gpu, &g, named.map(|(_, name)| name));
        for ((got, want), (_, name)) in got.iter().zip(&want).zip(named) {
            assert_close(name, got, want, 2e-5);
        }
    }
}

#[test]
fn a_quantile_a_drop_and_a_norm() {
    let mut g = Graph::new();
    let x = g.input("x", [2, 5000]);
    let which = Which::Quantile { numerator: 49, denominator: 50 };
    let threshold = g.rank(x, which).expect("rank");
    let step = indices(&mut g, "step", &[1], &[12]);
    let dropped = g.dropout(x, step, 0.1, (7, 3)).expect("dropout");
    let gradient = g.input("gradient", [70, 9]);
    let clip = g.grad_norm(&[gradient, x], 1.0, 0.5).expect("norm");
    let named = [(threshold, "threshold"), (dropped, "dropped"), (clip, "clip")];
    for (value, name) in named {
        g.output(value, name);
    }
    let x = numbers("x", 10_000);
    let clip =
        cpu::grad_norm(&omnix_kernels::grad_norm::Clip { max_norm: 1.0, scale: 0.5 }, &[&numbers("gradient", 630), &x]);
    let threshold = cpu::rank(&omnix_kernels::rank::Rank { rows: 2, n: 5000, which }, &x);
    let drop = omnix_kernels::dropout::Dropout { n: 10_000, p: 0.1, seed: 7, stream: 3 };
    let want = [threshold, cpu::dropout(&drop, 12, &x), clip.to_vec()];
    for gpu in tiers() {
        let got = outputs(&gpu, &g, named.map(|(_, name)| name));
        for ((got, want), (_, name)) in got.iter().zip(&want).zip(named) {
            assert_close(name, got, want, 2e-6);
        }
    }
    let three = g.input("three", [3]);
    assert!(g.rank(three, which).is_err() && g.grad_norm(&[], 1.0, 1.0).is_err());
    assert!(g.grad_norm(&[gradient], 0.0, 1.0).is_err() && g.dropout(gradient, three, 1.0, (0, 0)).is_err());
}

/// Weights, moments and an average lie in inputs, which the nodes change; a second run goes on from there.
#[test]
fn an_optimiser_writes_its_inputs() {
    const N: usize = 630;
    let mut g = Graph::new();
    let state = ["w", "m", "v"].map(|name| g.input(name, [70, 9]));
    let (gradient, average) = (g.input("gradient", [70, 9]), g.input("average", [70, 9]));
    let (rates, shares) = (g.input("rates", [4]), g.input("shares", [2]));
    let clip = g.grad_norm(&[gradient], 1.0, 1.0).expect("norm");
    g.output(clip, "clip");
    let betas = [0.9, 0.95];
    let spec = omnix_kernels::adamw::AdamW { n: N as u64, betas, eps: 1e-8, scale: 1.0, clip: true };
    let step = AdamW { state, gradient, rates, clip: Some(clip), betas, eps: 1e-8, scale: 1.0 };
    g.adamw(&step).expect("step");
    g.blend(average, state[0], shares).expect("average");
    for gpu in tiers() {
        let executable = prepare(&gpu, &g, &PlanOptions::default());
        let mut want = [numbers("w", N), vec![0.0; N], vec![0.0; N]];
        let mut mean = numbers("average", N);
        for (name, numbers) in [("w", &want[0]), ("m", &want[1]), ("v", &want[2]), ("average", &mean)] {
            executable.write(name, numbers).expect("writes");
        }
        executable.write("shares", &[0.9, 0.1]).expect("writes");
        for number in 1..=2 {
            let gradient: Vec<f32> = numbers("gradient", N).iter().map(|v| v / number as f32).collect();
            let rates = spec.rates(number, 0.01, 0.05);
            executable.write("gradient", &gradient).expect("writes");
            executable.write("rates", &rates).expect("writes");
            executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
            let clip = cpu::grad_norm(&omnix_kernels::grad_norm::Clip { max_norm: 1.0, scale: 1.0 }, &[&gradient]);
            want = cpu::adamw(&spec, [0, 1, 2].map(|i| want[i].as_slice()), &gradient, &rates, &clip);
            mean = cpu::blend(&mean, &want[0], [0.9, 0.1]);
            for (name, want) in [("w", &want[0]), ("m", &want[1]), ("v", &want[2]), ("average", &mean)] {
                assert_close(name, &executable.read(name).expect("reads"), want, 2e-6);
            }
        }
    }
    let (three, made) = (g.input("three", [3]), g.map(Unary::Neg, state[0]));
    assert!(g.adamw(&AdamW { rates: three, ..step.clone() }).is_err());
    assert!(g.adamw(&AdamW { gradient: three, ..step.clone() }).is_err());
    // What a node makes does not outlive a run.
    assert!(g.adamw(&AdamW { state: [made, state[1], state[2]], ..step }).is_err());
    assert!(g.blend(made, state[0], shares).is_err() && g.blend(average, three, shares).is_err());
}
