//! Tokens for every time, fields, and points that move.

use omnix_graph::ops::{Expand, Gate, Motion};
use omnix_kernels::Gpu;
use omnix_tests::{Rng, Trial, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!("motion", device: [tokens_for_every_time, tokens_at_their_cells, moved_points, scores_alone])
}

fn tokens_for_every_time(gpu: &Gpu) {
    for (i, (times, tokens, d)) in [(1, 1, 1), (3, 5, 7), (2, 33, 12), (4, 3, 64)].into_iter().enumerate() {
        for parts in 0..8 {
            // Each size with some of the combinations, all of which come.
            if parts % 4 != i && parts != 7 {
                continue;
            }
            let mut case = Case::new(format!("{times} x {tokens} x {d}, parts {parts:03b}"));
            let (q, shift) = (case.leaf("q", [tokens, d]), case.leaf("shift", [times, d]));
            let scale = (parts & 1 > 0).then(|| case.leaf("scale", [times, d]));
            let alpha = (parts & 2 > 0).then(|| case.leaf("alpha", [tokens, 1]));
            let kappa = (parts & 4 > 0).then(|| case.leaf("kappa", [tokens]));
            // Without a scale alpha has no part in the result.
            let y = case.graph.token_expand(q, shift, Expand { scale, alpha, kappa }).expect("records");
            let outputs: Vec<_> = std::iter::once(y).chain(alpha).collect();
            case.check(gpu, &outputs);
        }
    }
}

fn tokens_at_their_cells(gpu: &Gpu) {
    for (times, sources, k, cells, c) in [(1, 1, 1, 1, 1), (3, 2, 4, 9, 9), (2, 3, 5, 5, 4)] {
        let mut case = Case::new(format!("{k} of {cells} cells"));
        let z = case.leaf("z", [times, sources, k, c]);
        let index = |source: usize| {
            let mut some = Rng::new(source as u64).shuffled(cells as u32)[..k].to_vec();
            some.sort_unstable();
            some
        };
        let index: Vec<u32> = (0..sources).flat_map(index).collect();
        let index = case.indices("index", [sources, k], &index);
        let rest = case.numbers("rest", c);
        let rest = case.given("rest", [c], rest);
        let y = case.graph.field_scatter(z, index, rest, cells).expect("records");
        case.check(gpu, &[y]);
    }
}

/// Tau `[n, 9 T + 1]` with norms away from the floor, on both sides of it, and scores on both sides of the threshold.
fn tau(case: &Case, n: usize, times: usize, floor: f32) -> Vec<f32> {
    let mut data = case.numbers("tau", n * (9 * times + 1));
    let mut rng = Rng::new(8);
    for row in data.chunks_exact_mut(9 * times + 1) {
        for nine in row.chunks_exact_mut(9) {
            // The first column, and the second turned from it by a right angle or so: what Gram-Schmidt leaves is near its length.
            let below = [rng.below(4) == 0, rng.below(4) == 0];
            let length = |below: bool| if below { 0.5 * floor } else { floor.max(0.5) * 2.0 };
            let axis = rng.below(3) as usize;
            for (half, below) in below.into_iter().enumerate() {
                for (i, v) in nine[half * 3..half * 3 + 3].iter_mut().enumerate() {
                    let main = f32::from(u8::from(i == (axis + half) % 3));
                    *v = length(below) * (main + 0.1 * v.clamp(-1.0, 1.0));
                }
            }
        }
        let last = 9 * times;
        row[last] = if rng.below(2) == 0 { 0.1 } else { 0.8 };
    }
    data
}

/// A hard gate is straight-through: its derivative is that of a share which is 0 or 1 and changes with the score.
fn moved_points(gpu: &Gpu) {
    for gate in [Gate::None, Gate::Hard(0.3), Gate::Blend] {
        for (relative, min_norm) in [(true, 1e-3), (false, 1e-3), (true, 0.4), (false, 0.4)] {
            for (n, times, own) in [(1, 1, 0), (5, 3, 1)] {
                let motion = Motion { relative, min_norm, gate };
                let mut case = Case::new(format!("{motion:?}, {n} x {times}"));
                // A floor of 1e-3 is far from all norms; one of 0.4 has some below.
                let data = tau(&case, n, times, if min_norm < 0.1 { 1.0 } else { min_norm });
                let tau = case.leaf_with("tau", [n, 9 * times + 1], data);
                let points = case.leaf("points", [n, 3]);
                let when = case.indices("when", [1], &[own]);
                let (moved, scores) = case.graph.traj_apply(tau, points, when, motion).expect("records");
                case.check(gpu, &[moved, scores]);
            }
        }
    }
}

/// A loss of one of the two results alone.
fn scores_alone(gpu: &Gpu) {
    for first in [true, false] {
        let mut case = Case::new(if first { "points alone" } else { "scores alone" });
        let data = tau(&case, 4, 2, 1.0);
        let tau = case.leaf_with("tau", [4, 19], data);
        let points = case.leaf("points", [4, 3]);
        let when = case.indices("when", [2], &[1, 0]);
        let motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Blend };
        let (moved, scores) = case.graph.traj_apply(tau, points, when, motion).expect("records");
        case.check(gpu, &[if first { moved } else { scores }]);
    }
}
