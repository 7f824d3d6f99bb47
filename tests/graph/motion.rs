//! The operations of the trajectory module: from scored tokens to points that move.

use omnix_graph::ops::Expand;
use omnix_graph::ops::{Gate, Motion, Sampling, Trajectory};
use omnix_graph::{Graph, PlanOptions, Value};
use omnix_tests::{Rng, tiers};

use crate::support::{numbers, run};

const IMAGES: usize = 3;
const GRID: [usize; 2] = [2, 4];
const IMAGE: [usize; 2] = [14, 28];
const MOTION: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };

/// u32 numbers as a constant.
fn indices(g: &mut Graph, name: &str, values: &[u32]) -> Value {
    g.constant(name, [values.len()], values.iter().map(|v| f32::from_bits(*v)).collect())
}

/// Field `[images, times, cells, 9]` and mask `[images, cells]` of tokens `tokens [images · cells, 9]` under `scores`.
fn field(g: &mut Graph) -> (Value, Value) {
    let cells = GRID[0] * GRID[1];
    let tokens = g.input("tokens", [IMAGES * cells, 9]);
    let scores = g.input("scores", [IMAGES, cells]);
    let (index, mask) = g.top_k(scores, 3).expect("top_k");
    let (flat, _) = g.top_k_flat(scores, 3).expect("flat");
    let flat = g.reshape(flat, [IMAGES * 3]).expect("flat");
    let q = g.gather(tokens, flat).expect("chosen");
    let codes = g.constant("codes", [IMAGES, 9], Rng::new(5).normal(IMAGES * 9));
    let gain = g.input("gain", [IMAGES * 3, 1]);
    let z = g.token_expand(q, codes, Expand { kappa: Some(gain), ..Expand::default() }).expect("expand");
    let z = g.reshape(z, [IMAGES, IMAGES, 3, 9]).expect("pairs");
    let rest = g.constant("rest", [9], vec![0.001, 0.0, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0]);
    (g.field_scatter(z, index, rest, cells).expect("field"), mask)
}

/// Where image 1 samples.
fn sampling(g: &mut Graph, pixels: Option<Value>, n: usize) -> Sampling {
    let (field, mask) = field(g);
    let field = g.slice(field, 0, 1, 1).expect("one level of image 1");
    let mask = g.slice(mask, 0, 1, 1).expect("mask of image 1");
    let offsets = g.input("offsets", [n, 8]);
    let weights = g.input("weight", [n, 4]);
    let weights = g.softmax(weights);
    Sampling { offsets, weights, field, mask, pixels, image: IMAGE, grid: GRID }
}

#[test]
fn chosen_tokens_fill_the_field_and_the_rest_rests() {
    for gpu in tiers() {
        let mut g = Graph::new();
        let (field, _) = field(&mut g);
        g.output(field, "y");
        let field = run(&gpu, &g, &PlanOptions::default());
        let (tokens, gain) = (numbers("tokens", IMAGES * 8 * 9), numbers("gain", IMAGES * 3));
        let codes = Rng::new(5).normal(IMAGES * 9);
        let (_, mask) = omnix_kernels::cpu::top_k((8, 3), false, &numbers("scores", IMAGES * 8));
        let rest = [0.001, 0.0, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0];
        for s in 0..IMAGES {
            let mut rank = 0;
            for cell in 0..8 {
                let chosen = mask[s * 8 + cell] > 0.0;
                for (t, c) in (0..IMAGES).flat_map(|t| (0..9).map(move |c| (t, c))) {
                    let got = field[((s * IMAGES + t) * 8 + cell) * 9 + c];
                    let moved =
                        tokens[(s * 8 + cell) * 9 + c] + gain[(s * 3 + rank).min(gain.len() - 1)] * codes[t * 9 + c];
                    let want = if chosen { moved } else { rest[c] };
                    assert!(
                        (got - want).abs() < 1e-5,
                        "image {s}, time {t}, cell {cell}, channel {c}: {got}, not {want}"
                    );
                }
                rank += usize::from(chosen);
            }
            assert_eq!(rank, 3);
        }
    }
}

#[test]
fn the_joined_operation_gives_the_bits_of_the_two_and_any_range_of_times() {
    let n = IMAGE[0] * IMAGE[1];
    for gpu in tiers() {
        let mut g = Graph::new();
        let sampling = sampling(&mut g, None, n);
        let (points, own) = (g.input("points", [n, 3]), indices(&mut g, "when", &[1]));
        let tau = g.deform_sample(&sampling).expect("tau");
        let (moved, _) = g.traj_apply(tau, points, own, MOTION).expect("apply");
        g.output(moved, "y");
        let two = run(&gpu, &g, &PlanOptions::default());
        assert!(two.iter().all(|v| v.is_finite()));
        for (first, times) in [(0, 3), (1, 2), (2, 1)] {
            let mut g = Graph::new();
            let sampling = self::sampling(&mut g, None, n);
            let (points, when) = (g.input("points", [n, 3]), indices(&mut g, "when", &[1, first as u32]));
            let spec = Trajectory { sampling, points, when, times, motion: MOTION };
            let (moved, _) = g.trajectory(&spec).expect("records");
            g.output(moved, "y");
            let one = run(&gpu, &g, &PlanOptions::default());
            assert!(one == two[first * n * 3..(first + times) * n * 3], "{}: times from {first}", gpu.caps.tier);
        }
    }
}

#[test]
fn misfits_are_errors() {
    let mut g = Graph::new();
    let list = indices(&mut g, "pixels", &[3, 2, 1]);
    let good = sampling(&mut g, Some(list), 3);
    let (points, when) = (g.input("points", [3, 3]), indices(&mut g, "when", &[0, 0]));
    assert!(g.deform_sample(&good).is_ok());
    let short = indices(&mut g, "short", &[3]);
    for bad in [
        Sampling { pixels: None, ..good },
        Sampling { pixels: Some(short), ..good },
        Sampling { grid: [3, 4], ..good },
        Sampling { offsets: good.weights, ..good },
        Sampling { mask: points, ..good },
    ] {
        assert!(g.deform_sample(&bad).is_err(), "{bad:?}");
    }
    let spec = Trajectory { sampling: good, points, when, times: 3, motion: MOTION };
    assert!(g.trajectory(&spec).is_ok());
    for bad in [Trajectory { times: 4, ..spec }, Trajectory { times: 0, ..spec }, Trajectory { points: short, ..spec }]
    {
        assert!(g.trajectory(&bad).is_err());
    }
    assert!(g.trajectory(&Trajectory { when: short, ..spec }).is_err());
    let message = g.traj_apply(points, points, when, MOTION).expect_err("no tau").to_string();
    assert_eq!(message, "traj_apply: `points` has shape [3, 3], expected [n, 9 times + 1]");
    assert!(g.token_expand(points, when, Expand::default()).is_err());
    assert!(g.field_scatter(points, when, list, 8).is_err());
}
