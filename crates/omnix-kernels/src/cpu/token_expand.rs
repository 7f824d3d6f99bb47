//! Oracle of `token_expand`.

use crate::token_expand::TokenExpand;

/// `z[t, r, :] = q[r, :] · (1 + alpha[r] · scale[t, :]) + kappa[r] · shift[t, :]`; what the specification says is absent is not
/// read.
#[must_use]
pub fn token_expand(spec: &TokenExpand, [q, scale, shift, alpha, kappa]: [&[f32]; 5]) -> Vec<f32> {
    let (m, d) = (spec.m as usize, spec.d as usize);
    let mut z = Vec::new();
    for t in 0..spec.times as usize {
        for r in 0..m {
            let a = if spec.alpha { f64::from(alpha[r]) } else { 1.0 };
            let k = if spec.kappa { f64::from(kappa[r]) } else { 1.0 };
            for c in 0..d {
                let s = if spec.scale { f64::from(scale[t * d + c]) } else { 0.0 };
                z.push((f64::from(q[r * d + c]) * (1.0 + a * s) + k * f64::from(shift[t * d + c])) as f32);
            }
        }
    }
    z
}
