//! Oracle of `traj_apply`.

use crate::traj_apply::{Gate, Motion, TrajApply};

/// Points `[T, n, 3]` and scores `[n]` from tau `[n, 9 T + 1]` and points `[n, 3]`.
#[must_use]
pub fn traj_apply(spec: &TrajApply, tau: &[f32], points: &[f32], own: usize) -> (Vec<f32>, Vec<f32>) {
    let (n, times) = (spec.n as usize, spec.times as usize);
    let Motion { relative, min_norm, gate } = spec.motion;
    let mut y = vec![0.0f32; times * n * 3];
    let mut theta = Vec::new();
    for i in 0..n {
        let row: Vec<f64> = tau[i * (times * 9 + 1)..][..times * 9 + 1].iter().map(|v| f64::from(*v)).collect();
        let x: Vec<f64> = points[i * 3..][..3].iter().map(|v| f64::from(*v)).collect();
        let score = row[times * 9];
        theta.push(score as f32);
        for t in 0..times {
            let now = &row[t * 9..][..9];
            let r = rotation(&now[..6], f64::from(min_norm));
            let mut shift = [now[6], now[7], now[8]];
            let mut turn = r;
            if relative {
                let then = &row[own * 9..][..9];
                let r_own = rotation(&then[..6], f64::from(min_norm));
                for a in 0..3 {
                    shift[a] -= then[6 + a];
                    for b in 0..3 {
                        turn[a][b] = (0..3).map(|c| r[a][c] * r_own[b][c]).sum();
                    }
                }
            }
            for a in 0..3 {
                let moved = (0..3).map(|b| turn[a][b] * x[b]).sum::<f64>() + shift[a];
                let result = match gate {
                    Gate::None => moved,
                    Gate::Hard(threshold) if score > f64::from(threshold) => moved,
                    Gate::Hard(_) => x[a],
                    Gate::Blend => x[a] + score * (moved - x[a]),
                };
                y[(t * n + i) * 3 + a] = result as f32;
            }
        }
    }
    (y, theta)
}

/// `R[row][column]` with the columns of Gram-Schmidt.
fn rotation(six: &[f64], min_norm: f64) -> [[f64; 3]; 3] {
    let dot = |a: &[f64], b: &[f64]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let unit = |v: [f64; 3]| v.map(|c| c / dot(&v, &v).sqrt().max(min_norm));
    let e1 = unit([six[0], six[1], six[2]]);
    let along = dot(&six[3..], &e1);
    let e2 = unit([six[3] - along * e1[0], six[4] - along * e1[1], six[5] - along * e1[2]]);
    let e3 = [e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]];
    [0, 1, 2].map(|i| [e1[i], e2[i], e3[i]])
}
