//! Operations that are made of others, shape errors, indices, timing.

use omnix_graph::ops::{Corners, Filter, Heads, Piece, ReduceOp, Splat, Unary};
use omnix_graph::profile::{profile, write_chrome_trace};
use omnix_graph::{Graph, ParameterSource as _, PlanOptions};
use omnix_tests::{Rng, assert_close, gpu, tiers};

use crate::support::{Seeded, feed, numbers, prepare, run, two_blocks};

#[test]
fn a_transposed_convolution_spreads_each_pixel() {
    for (k, out) in [(1, 3), (2, 5), (4, 8), (5, 6), (7, 2)] {
        let (frames, h, w, c) = (2, 3, 4, 8);
        let mut g = Graph::new();
        let x = g.input("x", [frames, h, w, c]);
        let (weight, bias) = (g.parameter("w", [c, out, k, k]), g.parameter("b", [out]));
        let y = g.conv_transpose2d(x, weight, Some(bias)).expect("records");
        g.output(y, "y");
        let seeded = Seeded(&g);
        let (weight, bias) = (seeded.read("w").expect("w"), seeded.read("b").expect("b"));
        let input = numbers("x", frames * h * w * c);
        let mut want = vec![0.0f32; frames * h * k * w * k * out];
        for f in 0..frames {
            for (row, column) in (0..h * k).flat_map(|r| (0..w * k).map(move |c| (r, c))) {
                for o in 0..out {
                    let pixel = (f * h + row / k) * w + column / k;
                    let sum: f64 = (0..c)
                        .map(|i| {
                            let at = ((i * out + o) * k + row % k) * k + column % k;
                            f64::from(input[pixel * c + i]) * f64::from(weight[at])
                        })
                        .sum();
                    want[((f * h * k + row) * w * k + column) * out + o] = (sum + f64::from(bias[o])) as f32;
                }
            }
        }
        for gpu in tiers() {
            assert_close(&format!("k {k}, {}", gpu.caps.tier), &run(&gpu, &g, &PlanOptions::default()), &want, 2e-6);
        }
    }
}

#[test]
fn a_code_goes_to_columns_in_half_of_the_channels_and_to_rows_in_the_other() {
    let (frames, h, w, c) = (2, 5, 7, 16);
    let mut g = Graph::new();
    let x = g.input("x", [frames, h, w, c]);
    let table = Rng::new(2).normal((w + h) * c / 2);
    let code = g.constant("code", [w + h, c / 2], table.clone());
    // At its own size a map keeps its numbers.
    let y = g.resize_coded(x, [h, w], Filter::Bilinear, Corners::Align, Some(code)).expect("coded");
    g.output(y, "y");
    let input = numbers("x", frames * h * w * c);
    let line = |pixel: usize, i: usize| if i < c / 2 { pixel % w } else { w + pixel / w % h };
    let want: Vec<f32> =
        (0..input.len()).map(|at| input[at] + table[line(at / c, at % c) * (c / 2) + at % c % (c / 2)]).collect();
    for gpu in tiers() {
        assert_close(&format!("{}", gpu.caps.tier), &run(&gpu, &g, &PlanOptions::default()), &want, 1e-7);
    }
    let error =
        g.resize_coded(x, [h, w + 1], Filter::Bilinear, Corners::Align, Some(code)).expect_err("too few columns");
    let error = error.to_string();
    assert!(error.contains("resize") && error.contains("code") && error.contains("[13, 8]"), "{error}");
}

#[test]
fn layout_operations_move_the_right_numbers() {
    let mut g = Graph::new();
    let x = g.input("x", [2, 3, 4]);
    let turned = g.permute(x, &[2, 0, 1]).expect("permute");
    let part = g.slice(turned, 0, 1, 2).expect("slice");
    let joined = g.concat(&[part, part], 1).expect("concat");
    let many = g.repeat(joined, 2).expect("repeat");
    let flat = g.reshape(many, [48]).expect("reshape");
    g.output(flat, "y");
    let input = numbers("x", 24);
    let at = |i: usize| {
        let (c, r, a) = (i / 12 % 2 + 1, i % 12 / 3 % 2, i % 3);
        input[r * 12 + a * 4 + c]
    };
    let want: Vec<f32> = (0..48).map(at).collect();
    assert_eq!(run(gpu(), &g, &PlanOptions::default()), want);
}

#[test]
fn rows_go_through_gather_scatter_and_top_k() {
    let mut g = Graph::new();
    let scores = g.input("scores", [1, 6]);
    let (index, mask) = g.top_k(scores, 3).expect("top_k");
    let index = g.reshape(index, [3]).expect("index");
    let rows = g.input("rows", [6, 4]);
    let picked = g.gather(rows, index).expect("gather");
    // Other numbers than those that were there: a scatter that writes nothing would be seen.
    let doubled = g.map(Unary::ScaleShift { s: 2.0, t: 1.0 }, picked);
    let back = g.scatter(rows, doubled, index).expect("scatter");
    let mask = g.reshape(mask, [6]).expect("mask");
    let kept = g.zip_rows(omnix_graph::ops::Binary::Mul, back, mask).expect("mask");
    let sums = g.reduce(kept, ReduceOp::Sum, 1).expect("sum");
    g.output(sums, "y");
    let (scores, rows) = (numbers("scores", 6), numbers("rows", 24));
    let mut order: Vec<usize> = (0..6).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    let want: Vec<f32> = (0..6)
        .map(|r| if order[..3].contains(&r) { rows[r * 4..][..4].iter().map(|v| 2.0 * v + 1.0).sum() } else { 0.0 })
        .collect();
    assert_close("masked rows", &run(gpu(), &g, &PlanOptions::default()), &want, 1e-6);
}

#[test]
fn shape_errors_name_operation_value_and_both_shapes() {
    let mut g = Graph::new();
    let x = g.input("tokens", [5, 12]);
    let w = g.parameter("blocks.0.fc1.weight", [20, 13]);
    let message = g.linear(x, w, None).expect_err("does not fit").to_string();
    assert_eq!(message, "linear: `blocks.0.fc1.weight` has shape [20, 13], expected [n, 12]");
    assert!(g.reshape(x, [7]).is_err() && g.permute(x, &[0, 0]).is_err() && g.slice(x, 1, 10, 3).is_err());
    assert!(g.top_k(x, 13).is_err() && g.conv2d(x, w, None, 1, 1).is_err());
}

#[test]
fn arguments_that_no_operation_takes_are_errors_and_never_a_panic() {
    let mut g = Graph::new();
    let (scalar, row) = (g.input("scalar", [0usize; 0]), g.input("row", [3]));
    let (matrix, index) = (g.input("matrix", [3, 4]), g.input("index", [2]));
    let map = g.input("map", [1, 4, 4, 3]);
    let kernel = g.parameter("kernel", [8, 3, 3, 3]);
    assert_eq!(g.concat(&[], 0).expect_err("nothing").to_string(), "concat: there are no values to join");
    assert!(g.concat(&[row, row], 1).is_err() && g.concat(&[scalar], 0).is_err(), "no such axis");
    assert!(g.gather(scalar, index).is_err() && g.gather(matrix, matrix).is_err(), "nothing to take rows of");
    assert!(g.scatter(scalar, matrix, index).is_err() && g.scatter(matrix, scalar, index).is_err(), "no rows to write");
    assert!(g.scatter(matrix, row, index).is_err() && g.scatter(matrix, matrix, index).is_err());
    assert!(g.reduce(scalar, ReduceOp::Sum, 0).is_err() && g.slice(row, 0, usize::MAX, 2).is_err());
    assert!(g.attention(row, matrix, matrix).is_err() && g.attention(scalar, scalar, scalar).is_err());
    assert!(g.conv2d(map, kernel, None, 0, 1).is_err(), "a stride of 0");
    let code = g.constant("code", [8, 1], vec![0.0; 8]);
    assert!(g.resize_coded(map, [4, 4], Filter::Bilinear, Corners::Align, Some(code)).is_err(), "odd channels");
    let heads = Heads { groups: 0, heads: 1, head_dim: 4, norm: None, rope: None };
    assert!(g.query_heads(matrix, 0, &heads).is_err(), "no groups");
    let half = Piece { value: row, dims: vec![3], start: 0, strides: vec![1], at: vec![0] };
    assert!(g.assemble([6], std::slice::from_ref(&half)).is_err(), "three of six numbers are never written");
    assert!(g.assemble([6], &[half.clone(), Piece { at: vec![3], ..half }]).is_ok());
    let (points, sizes, view) = (g.input("points", [5, 3]), g.input("sizes", [5]), g.input("view", [24]));
    let splat = Splat { points, sizes, colours: sizes, view, size: [4, 6], largest: 8 };
    assert!(g.splat(&splat).is_ok());
    for bad in [
        Splat { points: sizes, ..splat },
        Splat { sizes: row, ..splat },
        Splat { view: row, ..splat },
        Splat { size: [0, 6], ..splat },
        Splat { size: [4, 1 << 33], ..splat },
        Splat { largest: 0, ..splat },
    ] {
        assert!(g.splat(&bad).is_err(), "{bad:?}");
    }
    let deep = g.input("deep", [1, 1, 1, 1, 1, 1, 2]);
    assert!(g.permute(deep, &[6, 5, 4, 3, 2, 1, 0]).is_err(), "a copy has six axes");
    let wide = g.input("wide", [2, 1 << 33]);
    let message = g.permute(wide, &[1, 0]).expect_err("more than 32 bits").to_string();
    assert!(message.contains("32-bit"), "{message}");
}

#[test]
fn wrong_lengths_and_names_are_errors() {
    let graph = two_blocks(2, 8, (1, 8));
    let executable = prepare(gpu(), &graph, &PlanOptions::default());
    assert!(executable.write("x", &[0.0; 3]).is_err());
    assert!(executable.write_at("x", 16 * 8 - 1, &[0.0; 2]).is_err());
    assert!(executable.write("nothing", &[]).is_err() && executable.read("nothing").is_err());
}

#[test]
fn the_profile_names_every_node_and_traces_as_json() {
    let graph = two_blocks(2, 40, (2, 32));
    let executable = prepare(gpu(), &graph, &PlanOptions::default());
    feed(&executable, &graph);
    let spans = profile(&executable).expect("profiles");
    assert_eq!(spans.len(), executable.plan().graph.nodes().len());
    assert!(spans.iter().any(|s| s.op == "attention") && spans.iter().all(|s| s.length_ns >= 0.0));
    let mut out = Vec::new();
    write_chrome_trace(&spans, &mut out).expect("writes");
    let trace: serde_json::Value = serde_json::from_slice(&out).expect("JSON");
    assert_eq!(trace["traceEvents"].as_array().map(Vec::len), Some(spans.len()));
}

#[test]
fn breaking_off_is_an_error_and_the_plan_runs_again() {
    let graph = two_blocks(2, 40, (2, 32));
    let executable = prepare(gpu(), &graph, &PlanOptions::default());
    feed(&executable, &graph);
    let stopped = executable.run(&mut |_, _| std::ops::ControlFlow::Break(()));
    assert!(matches!(stopped, Err(omnix_graph::GraphError::Interrupted)));
    executable.run(&mut |_, _| std::ops::ControlFlow::Continue(())).expect("runs again");
    assert!(executable.read("y").expect("reads").iter().all(|v| v.is_finite()));
}
