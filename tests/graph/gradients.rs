//! Operations of the backward pass against the operations whose gradients they are, on the device and through plans: what is linear in
//! its operand gives back the sum it was weighed with, the others agree with central differences.

use std::ops::ControlFlow;

use omnix_graph::ops::{Corners, Filter, HeadNorm, Heads, Op, SplitHeads};
use omnix_graph::{Graph, ParameterSource as _, PlanOptions, Value};
use omnix_kernels::Gpu;
use omnix_tests::tiers;

use crate::support::{Seeded, numbers, prepare};

/// The outputs `wanted` of a graph; inputs are seeded by their names but for those given.
fn compute(gpu: &Gpu, graph: &Graph, given: &[(&str, &[f32])], wanted: &[&str]) -> Vec<Vec<f32>> {
    let executable = prepare(gpu, graph, &PlanOptions::default());
    crate::support::feed(&executable, graph);
    for (name, values) in given {
        executable.write(name, values).expect("writes");
    }
    executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
    wanted.iter().map(|name| executable.read(name).expect("reads")).collect()
}

/// Σ a b.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "lengths");
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// Asserts that two sums of the same terms agree within `limit` of `scale`.
#[track_caller]
fn assert_equal(what: &str, got: f64, want: f64, scale: f64, limit: f64) {
    assert!((got - want).abs() <= limit * scale, "{what}: {got} for {want}, scale {scale}");
}

fn norm(v: &[f32]) -> f64 {
    dot(v, v).sqrt()
}

#[test]
fn what_is_linear_gives_back_its_weighted_sum() {
    let (frames, h, w, ci, co) = (2, 9, 7, 8, 12);
    let mut g = Graph::new();
    let x = g.input("x", [frames, h, w, ci]);
    // A convolution: its output weighed with r is its weights weighed with their gradient.
    let (weight, bias) = (g.parameter("conv.w", [co, ci, 3, 3]), g.parameter("conv.b", [co]));
    let y = g.conv2d(x, weight, Some(bias), 2, 1).expect("conv2d");
    let [ho, wo] = [g.shape(y)[1], g.shape(y)[2]];
    let r = g.input("r", [frames, ho, wo, co]);
    let (dw, db) = g.conv2d_weights(x, r, [3, 3], 2, 1, true).expect("conv2d_weights");
    // A linear layer over its pixels.
    let (matrix, offset) = (g.parameter("linear.w", [20, co]), g.parameter("linear.b", [20]));
    let z = g.linear(y, matrix, Some(offset)).expect("linear");
    let s = g.input("s", [frames, ho, wo, 20]);
    let (dm, d_offset) = g.linear_weights(y, s, true).expect("linear_weights");
    // Resizing: its output weighed with t is its input weighed with the gradient.
    let large = g.resize(x, 20, 11, Filter::Bicubic, Corners::HalfPixel).expect("resize");
    let t = g.input("t", [frames, 20, 11, ci]);
    let dx = g.resize_grad(t, [h, w], Filter::Bicubic, Corners::HalfPixel).expect("resize_grad");
    let outputs = [y, dw, db.expect("asked for"), z, dm, d_offset.expect("asked for"), large, dx];
    let names = ["y", "dw", "db", "z", "dm", "do", "large", "dx"];
    for (value, name) in outputs.into_iter().zip(names) {
        g.output(value, name);
    }
    let seeded = Seeded(&g);
    let parameter = |name: &str| seeded.read(name).expect("a parameter").into_owned();
    let seed = |name: &str, like: &[f32]| numbers(name, like.len());
    for gpu in tiers() {
        let got = compute(&gpu, &g, &[], &names);
        let [y, dw, db, z, dm, d_offset, large, dx] = <[Vec<f32>; 8]>::try_from(got).expect("eight");
        let (r, s, t) = (seed("r", &y), seed("s", &z), seed("t", &large));
        let conv = dot(&dw, &parameter("conv.w")) + dot(&db, &parameter("conv.b"));
        assert_equal("conv2d", conv, dot(&y, &r), norm(&y) * norm(&r), 1e-6);
        let linear = dot(&dm, &parameter("linear.w")) + dot(&d_offset, &parameter("linear.b"));
        assert_equal("linear", linear, dot(&z, &s), norm(&z) * norm(&s), 1e-6);
        assert_equal("resize", dot(&dx, &seed("x", &dx)), dot(&large, &t), norm(&large) * norm(&t), 1e-6);
    }
}

#[test]
fn a_layer_norm_agrees_with_central_differences() {
    let shape = [3, 7, 24];
    let record = |with_grad: bool| {
        let mut g = Graph::new();
        let (x, weight) = (g.input("x", shape), g.input("weight", [24]));
        if with_grad {
            let r = g.input("r", shape);
            let (dx, affine) = g.layer_norm_grad(x, Some(weight), r, 1e-6, true).expect("layer_norm_grad");
            let [d_weight, d_bias] = affine.expect("asked for");
            for (value, name) in [(dx, "dx"), (d_weight, "d_weight"), (d_bias, "d_bias")] {
                g.output(value, name);
            }
        } else {
            let bias = g.input("bias", [24]);
            let y = g.layer_norm(x, Some(weight), Some(bias), 1e-6).expect("layer_norm");
            g.output(y, "y");
        }
        g
    };
    let (forward, backward) = (record(false), record(true));
    let r = numbers("r", shape.iter().product());
    for gpu in tiers() {
        let slope = |input: &str, count: usize| slope(&gpu, &forward, input, count, &r);
        let got = compute(&gpu, &backward, &[], &["dx", "d_weight", "d_bias"]);
        for (gradient, input) in got.iter().zip(["x", "weight", "bias"]) {
            let way = numbers("way", gradient.len());
            let want = slope(input, gradient.len());
            assert_equal(input, dot(gradient, &way), want, norm(gradient) * norm(&way), 1e-3);
        }
    }
}

/// The slope of Σ r y in the direction `way` of an input, by central differences.
fn slope(gpu: &Gpu, forward: &Graph, input: &str, count: usize, r: &[f32]) -> f64 {
    const STEP: f32 = 1e-2;
    let (at, way) = (numbers(input, count), numbers("way", count));
    let [more, less] = [STEP, -STEP].map(|step| {
        let moved: Vec<f32> = at.iter().zip(&way).map(|(at, way)| at + step * way).collect();
        dot(&compute(gpu, forward, &[(input, &moved)], &["y"])[0], r)
    });
    (more - less) / (2.0 * f64::from(STEP))
}

const GROUPS: usize = 2;
const TOKENS: usize = 37;
const HEADS: usize = 2;
const WIDTH: usize = 16;

/// A node of the graph as the operation that splits heads.
fn heads_of(g: &Graph, value: Value) -> SplitHeads {
    let node = g.nodes().iter().find(|node| node.outputs[0] == value).expect("a node");
    if let Op::SplitHeads(heads) = &node.op { heads.clone() } else { panic!("no heads: {node:?}") }
}

/// Attention of tokens to themselves, q and k with norm and RoPE, and with `r` the gradients of everything that goes in.
fn attention(with_grad: bool) -> Graph {
    let c = HEADS * WIDTH;
    let mut g = Graph::new();
    let x = g.input("x", [GROUPS * TOKENS, 3 * c]);
    let (weight, bias) = (g.input("weight", [WIDTH]), g.input("bias", [WIDTH]));
    let angles = numbers("angles", TOKENS * WIDTH / 2);
    let table = angles.chunks(WIDTH / 2).flat_map(|row| {
        let (cosines, sines): (Vec<f32>, Vec<f32>) = row.iter().map(|a| (a.cos(), a.sin())).unzip();
        [cosines, sines].concat()
    });
    let table: Vec<f32> = table.collect();
    let rope = g.constant("rope", [TOKENS, WIDTH], table);
    let norm = HeadNorm { weight, bias, eps: 1e-5 };
    let spec = Heads { groups: GROUPS, heads: HEADS, head_dim: WIDTH, norm: Some(norm), rope: Some(rope) };
    let q = g.query_heads(x, 0, &spec).expect("q");
    let k = g.key_heads(x, c, &spec).expect("k");
    let v = g.value_heads(x, 2 * c, &spec).expect("v");
    let (y, state) = g.attention_with_state(q, k, v).expect("attention");
    g.output(y, "y");
    if with_grad {
        let r = g.input("r", [GROUPS * TOKENS, c]);
        let d_out = g.value_heads(r, 0, &spec).expect("heads of r");
        let (dq, facts) = g.attention_grad_q([q, k, v], [y, state], d_out).expect("attention_grad_q");
        let (dk, dv) = g.attention_grad_kv([q, k, v], d_out, facts).expect("attention_grad_kv");
        for (heads, gradient, name) in [(q, dq, "q"), (k, dk, "k"), (v, dv, "v")] {
            let heads = heads_of(&g, heads);
            let (dx, affine) = g.split_heads_grad(heads, gradient).expect("split_heads_grad");
            g.output(dx, &format!("d{name}"));
            if let Some([d_weight, d_bias]) = affine {
                g.output(d_weight, &format!("d{name}_weight"));
                g.output(d_bias, &format!("d{name}_bias"));
            }
        }
    }
    g
}

#[test]
fn attention_and_its_heads_agree_with_central_differences() {
    let (forward, backward) = (attention(false), attention(true));
    let c = HEADS * WIDTH;
    let r = numbers("r", GROUPS * TOKENS * c);
    let names = ["dq", "dk", "dv", "dq_weight", "dk_weight", "dq_bias", "dk_bias"];
    for gpu in tiers() {
        let got = compute(&gpu, &backward, &[], &names);
        let [dq, dk, dv, weight_q, weight_k, bias_q, bias_k] = <[Vec<f32>; 7]>::try_from(got).expect("seven");
        let rows = dq.chunks(c).zip(dk.chunks(c)).zip(dv.chunks(c));
        let dx: Vec<f32> = rows.flat_map(|((q, k), v)| [q, k, v].concat()).collect();
        let sum = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<f32>>();
        let gradients = [("x", dx), ("weight", sum(&weight_q, &weight_k)), ("bias", sum(&bias_q, &bias_k))];
        for (input, gradient) in gradients {
            let way = numbers("way", gradient.len());
            let want = slope(&gpu, &forward, input, gradient.len(), &r);
            let what = format!("{} {input}", gpu.caps.tier);
            assert_equal(&what, dot(&gradient, &way), want, norm(&gradient) * norm(&way), 1e-3);
        }
    }
}

#[test]
fn shapes_that_do_not_fit_are_errors() {
    let mut g = Graph::new();
    let rows = g.input("rows", [6, 8]);
    let other = g.input("other", [5, 4]);
    let map = g.input("map", [2, 6, 6, 4]);
    assert!(g.linear_weights(rows, other, false).is_err());
    assert!(g.conv2d_weights(map, map, [3, 3], 1, 0, true).is_err());
    assert!(g.conv2d_weights(map, map, [3, 3], 0, 1, true).is_err());
    assert!(g.layer_norm_grad(rows, None, other, 1e-6, false).is_err());
    assert!(g.resize_grad(rows, [3, 3], Filter::Bilinear, Corners::Align).is_err());
    let spec = Heads { groups: 2, heads: 2, head_dim: 4, norm: None, rope: None };
    let q = g.query_heads(rows, 0, &spec).expect("q");
    let k = g.key_heads(rows, 0, &spec).expect("k");
    let (out, state) = g.attention_with_state(q, k, q).expect("attention");
    assert!(g.attention_grad_q([q, k, q], [out, state], rows).is_err());
    assert!(g.attention_grad_kv([q, k, q], q, state).is_err());
    let heads = heads_of(&g, q);
    assert!(g.split_heads_grad(heads, rows).is_err());
}
