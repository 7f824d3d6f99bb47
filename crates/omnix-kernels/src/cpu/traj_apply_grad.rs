//! Oracle of `traj_apply_grad`: the equations of `traj_apply` over numbers that carry a derivative, once for every input.

use std::ops::{Add, Div, Mul, Sub};

use crate::traj_apply::Gate;
use crate::traj_apply_grad::TrajApplyGrad;

/// A number and its derivative with respect to one input.
#[derive(Clone, Copy, Debug)]
struct Dual(f64, f64);

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.0 + self.0 * other.1)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.0 / other.0;
        Self(value, (self.1 - value * other.1) / other.0)
    }
}

fn dot(a: [Dual; 3], b: [Dual; 3]) -> Dual {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `v / max(|v|, floor)`: below the floor the divisor is constant.
fn unit(v: [Dual; 3], floor: f64) -> [Dual; 3] {
    let squares = dot(v, v);
    let size = squares.0.sqrt();
    let divisor = if size >= floor { Dual(size, 0.5 * squares.1 / size) } else { Dual(floor, 0.0) };
    v.map(|c| c / divisor)
}

/// The columns of Gram-Schmidt.
fn columns(six: [Dual; 6], floor: f64) -> [[Dual; 3]; 3] {
    let [a, b] = [[six[0], six[1], six[2]], [six[3], six[4], six[5]]];
    let e1 = unit(a, floor);
    let along = dot(b, e1);
    let e2 = unit([0, 1, 2].map(|i| b[i] - along * e1[i]), floor);
    let turned = |i: usize, j: usize| e1[i] * e2[j] - e1[j] * e2[i];
    [e1, e2, [turned(1, 2), turned(2, 0), turned(0, 1)]]
}

/// Where a point goes: `R(now) R(own)ᵀ x + c(now) − c(own)`, or without the own time.
fn moved(now: [Dual; 9], own: Option<[Dual; 9]>, x: [Dual; 3], floor: f64) -> [Dual; 3] {
    let six = |nine: [Dual; 9]| [0, 1, 2, 3, 4, 5].map(|i| nine[i]);
    let mut anchor = x;
    let mut shift = [now[6], now[7], now[8]];
    if let Some(own) = own {
        let r = columns(six(own), floor);
        anchor = r.map(|column| dot(column, x));
        shift = [0, 1, 2].map(|i| shift[i] - own[6 + i]);
    }
    let r = columns(six(now), floor);
    [0, 1, 2].map(|i| r[0][i] * anchor[0] + r[1][i] * anchor[1] + r[2][i] * anchor[2] + shift[i])
}

/// dtau `[n, 9 T + 1]` and dpoints `[n, 3]`; dtheta is read where the specification says so.
#[must_use]
pub fn traj_apply_grad(
    spec: &TrajApplyGrad,
    [tau, points, dy, dtheta]: [&[f32]; 4],
    own: usize,
) -> (Vec<f32>, Vec<f32>) {
    let (n, times) = (spec.n as usize, spec.times as usize);
    let (row, floor) = (times * 9 + 1, f64::from(spec.motion.min_norm));
    let mut dtau = vec![0.0f64; n * row];
    let mut dpoints = vec![0.0f64; n * 3];
    for i in 0..n {
        let score = f64::from(tau[i * row + times * 9]);
        let x = [0, 1, 2].map(|c| f64::from(points[i * 3 + c]));
        if spec.theta {
            dtau[i * row + times * 9] += f64::from(dtheta[i]);
        }
        for t in 0..times {
            let g = [0, 1, 2].map(|c| f64::from(dy[(t * n + i) * 3 + c]));
            // The share of the moved point, of the one that stands still, and whether the score is asked for.
            let (share, still, scored) = match spec.motion.gate {
                Gate::None => (1.0, 0.0, false),
                Gate::Hard(threshold) if score > f64::from(threshold) => (1.0, 0.0, true),
                Gate::Hard(_) => (0.0, 1.0, true),
                Gate::Blend => (score, 1.0 - score, true),
            };
            // The derivative of g · moved with respect to input `k`: 9 numbers of now, 9 of the own time, 3 of the point.
            let derivative = |k: usize| {
                let seed = |value: f64, at: usize| Dual(value, f64::from(u8::from(at == k)));
                let nine = |t: usize, base: usize| -> [Dual; 9] {
                    std::array::from_fn(|c| seed(f64::from(tau[i * row + t * 9 + c]), base + c))
                };
                let point = [0, 1, 2].map(|c| seed(x[c], 18 + c));
                let own = spec.motion.relative.then(|| nine(own, 9));
                let result = moved(nine(t, 0), own, point, floor);
                (0..3).map(|c| g[c] * result[c].1).sum::<f64>()
            };
            for k in 0..9 {
                dtau[i * row + t * 9 + k] += share * derivative(k);
                if spec.motion.relative {
                    dtau[i * row + own * 9 + k] += share * derivative(9 + k);
                }
            }
            for c in 0..3 {
                dpoints[i * 3 + c] += share * derivative(18 + c) + still * g[c];
            }
            if scored {
                let plain =
                    |t: usize| -> [Dual; 9] { std::array::from_fn(|c| Dual(f64::from(tau[i * row + t * 9 + c]), 0.0)) };
                let to = moved(plain(t), spec.motion.relative.then(|| plain(own)), x.map(|c| Dual(c, 0.0)), floor);
                dtau[i * row + times * 9] += (0..3).map(|c| g[c] * (to[c].0 - x[c])).sum::<f64>();
            }
        }
    }
    let narrow = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
    (narrow(dtau), narrow(dpoints))
}
