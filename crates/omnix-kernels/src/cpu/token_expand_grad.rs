//! Oracle of `token_expand_grad`.

use crate::token_expand_grad::TokenExpandGrad;

/// Gradients of q `[m, d]`, of alpha and kappa `[m, 2]`, and of scale and shift `[T, 2, d]`; what the specification says is absent
/// is not read.
#[must_use]
pub fn token_expand_grad(
    spec: &TokenExpandGrad,
    [q, scale, shift, alpha, kappa, dz]: [&[f32]; 6],
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let (m, d, times) = (spec.m as usize, spec.d as usize, spec.times as usize);
    let mut dq = vec![0.0f64; m * d];
    let mut drow = vec![0.0f64; m * 2];
    let mut dtime = vec![0.0f64; times * 2 * d];
    for t in 0..times {
        for r in 0..m {
            let a = if spec.alpha { f64::from(alpha[r]) } else { 1.0 };
            let k = if spec.kappa { f64::from(kappa[r]) } else { 1.0 };
            for c in 0..d {
                let s = if spec.scale { f64::from(scale[t * d + c]) } else { 0.0 };
                let (token, g) = (f64::from(q[r * d + c]), f64::from(dz[(t * m + r) * d + c]));
                dq[r * d + c] += g * (1.0 + a * s);
                drow[r * 2] += g * token * s;
                drow[r * 2 + 1] += g * f64::from(shift[t * d + c]);
                dtime[t * 2 * d + c] += g * token * a;
                dtime[(t * 2 + 1) * d + c] += g * k;
            }
        }
    }
    let narrow = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
    (narrow(dq), narrow(drow), narrow(dtime))
}
