//! The trajectory module and its sampling head: tokens for every time, fields, sampling, moved points.

use omnix_graph::Value;
use omnix_graph::ops::{FieldScatter, Gate, Motion, Sampling, TokenExpand, TrajApply, Trajectory};

use super::{Run, index};

impl Run<'_> {
    pub(super) fn token_expand(&self, op: &TokenExpand) -> Vec<f64> {
        let d = self.width(op.q);
        let (q, shift) = (self.get(op.q), self.get(op.shift));
        let or = |value: Option<Value>, i: usize, absent: f64| value.map_or(absent, |v| self.get(v)[i]);
        let mut z = Vec::with_capacity(shift.len() / d * q.len());
        for time in 0..shift.len() / d {
            for (i, q) in q.iter().enumerate() {
                let (row, at) = (i / d, time * d + i % d);
                z.push(q * (1.0 + or(op.alpha, row, 1.0) * or(op.scale, at, 0.0)) + or(op.kappa, row, 1.0) * shift[at]);
            }
        }
        z
    }

    pub(super) fn field_scatter(&self, op: &FieldScatter, y: Value) -> Vec<f64> {
        let [times, sources, k, c] = self.map_dims(op.z);
        let cells = self.dims(y)[2];
        let (z, index) = (self.get(op.z), self.indices(op.index));
        let mut field = self.get(op.rest).repeat(sources * times * cells);
        for (s, t) in (0..sources).flat_map(|s| (0..times).map(move |t| (s, t))) {
            for i in 0..k {
                let from = &z[((t * sources + s) * k + i) * c..][..c];
                field[((s * times + t) * cells + index[s * k + i]) * c..][..c].copy_from_slice(from);
            }
        }
        field
    }

    /// Nine numbers for each time, then the score, of each pixel.
    pub(super) fn deform_sample(&self, op: &Sampling) -> Vec<f64> {
        let [levels, times, cells, channels] = self.map_dims(op.field);
        let (taps, [hp, wp], [height, width]) = (self.width(op.weights), op.grid, op.image);
        let [offsets, weights, field, mask] = [op.offsets, op.weights, op.field, op.mask].map(|v| self.get(v));
        let rows = weights.len() / taps;
        let pixels = op.pixels.map_or_else(|| (0..rows).collect(), |pixels| self.indices(pixels));
        let mut tau = Vec::with_capacity(rows * (times * channels + 1));
        for (i, pixel) in pixels.into_iter().enumerate() {
            let mut row = vec![0.0; times * channels + 1];
            for tap in 0..taps {
                let at = i * taps + tap;
                let x = coordinate(pixel % width, width, offsets[2 * at], wp);
                let y = coordinate(pixel / width, height, offsets[2 * at + 1], hp);
                let level = tap / (taps / levels);
                for (cell, share) in around([y, x], [hp, wp]) {
                    let weight = weights[at] * share;
                    for time in 0..times {
                        let from = &field[((level * times + time) * cells + cell) * channels..][..channels];
                        let to = &mut row[time * channels..][..channels];
                        to.iter_mut().zip(from).for_each(|(o, v)| *o += weight * v);
                    }
                    row[times * channels] += weight * mask[cell];
                }
            }
            tau.extend(row);
        }
        tau
    }

    pub(super) fn traj_apply(&self, op: &TrajApply) -> Vec<Vec<f64>> {
        let (own, tau) = (index(self.get(op.when)[0]), self.get(op.tau));
        let base = self.base.map_or(tau, |base| base.get(op.tau));
        moved((tau, base), self.get(op.points), own, op.motion)
    }

    pub(super) fn trajectory(&self, op: &Trajectory) -> Vec<Vec<f64>> {
        let (tau, points) = (self.deform_sample(&op.sampling), self.get(op.points));
        let when = self.indices(op.when);
        let mut results = moved((&tau, &tau), points, when[0], op.motion);
        results[0] = results[0][when[1] * points.len()..][..op.times * points.len()].to_vec();
        results
    }
}

/// Where a pixel's point lies on an axis of `cells` cells, in cells from the centre of the first.
fn coordinate(place: usize, size: usize, offset: f64, cells: usize) -> f64 {
    let reference = place as f64 / (size.max(2) - 1) as f64;
    (reference + offset / cells as f64).clamp(0.0, 1.0) * cells as f64 - 0.5
}

/// The cells whose centres surround a point, row then column, and the share of each; what would lie outside of the grid has none.
fn around([y, x]: [f64; 2], [hp, wp]: [usize; 2]) -> Vec<(usize, f64)> {
    let pair = |at: f64, cells: usize| {
        let (first, part) = (at.floor(), at - at.floor());
        let inside =
            move |(cell, share): (f64, f64)| (cell >= 0.0 && cell < cells as f64).then_some((cell as usize, share));
        [(first, 1.0 - part), (first + 1.0, part)].into_iter().filter_map(inside).collect::<Vec<_>>()
    };
    let columns = pair(x, wp);
    let of_row = |(row, share): (usize, f64)| columns.iter().map(move |(c, s)| (row * wp + c, share * s)).collect();
    pair(y, hp).into_iter().flat_map(|row: (usize, f64)| -> Vec<(usize, f64)> { of_row(row) }).collect()
}

/// Points `[T, n, 3]` and scores `[n]` of tau `[n, 9 T + 1]` and points `[n, 3]`. A hard gate is decided by the scores of `base`, a tau
/// that is equal or near, and changes with the score from there.
fn moved((tau, base): (&[f64], &[f64]), points: &[f64], own: usize, motion: Motion) -> Vec<Vec<f64>> {
    let n = points.len() / 3;
    let width = tau.len() / n;
    let times = width / 9;
    let own = own.min(times - 1);
    let (mut y, mut scores) = (vec![0.0; times * n * 3], Vec::with_capacity(n));
    for (i, row) in tau.chunks_exact(width).enumerate() {
        let (x, score, decided) = (&points[i * 3..][..3], row[width - 1], base[(i + 1) * width - 1]);
        scores.push(score);
        let share = match motion.gate {
            Gate::None => 1.0,
            Gate::Hard(threshold) => f64::from(u8::from(decided > f64::from(threshold))) + (score - decided),
            Gate::Blend => score,
        };
        let pose = |time: usize| {
            let nine = &row[time * 9..][..9];
            (rotation(&nine[..6], f64::from(motion.min_norm)), [nine[6], nine[7], nine[8]])
        };
        let (own_turn, own_shift) = pose(own);
        for time in 0..times {
            let (turn, shift) = pose(time);
            for a in 0..3 {
                let target: f64 = if motion.relative {
                    // R(t) R(own)ᵀ x + b(t) - b(own).
                    let back = |c: usize| (0..3).map(|b| own_turn[b][c] * x[b]).sum::<f64>();
                    (0..3).map(|c| turn[a][c] * back(c)).sum::<f64>() + shift[a] - own_shift[a]
                } else {
                    (0..3).map(|b| turn[a][b] * x[b]).sum::<f64>() + shift[a]
                };
                y[(time * n + i) * 3 + a] = x[a] + share * (target - x[a]);
            }
        }
    }
    vec![y, scores]
}

/// `R[row][column]`: its columns are six numbers after Gram-Schmidt, with a floor under the norms, and their cross product.
fn rotation(six: &[f64], floor: f64) -> [[f64; 3]; 3] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = |v: [f64; 3]| v.map(|c| c / dot(v, v).sqrt().max(floor));
    let (first, second) = (unit([six[0], six[1], six[2]]), [six[3], six[4], six[5]]);
    let along = dot(second, first);
    let second = unit([0, 1, 2].map(|i| second[i] - along * first[i]));
    let cross = |i: usize, j: usize| first[i] * second[j] - first[j] * second[i];
    let third = [cross(1, 2), cross(2, 0), cross(0, 1)];
    [0, 1, 2].map(|i| [first[i], second[i], third[i]])
}
