//! Oracle of `attention`.

use crate::attention::Attention;

/// Softmax attention in f64 over unpadded head-major `q[groups][heads][nq][D]`, `k` and `v` `[groups][heads][nk][D]`;
/// the result is `[groups · nq, heads · D]`.
#[must_use]
pub fn attention(spec: &Attention, q: &[f32], k: &[f32], v: &[f32]) -> Vec<f32> {
    let (groups, heads, d) = (spec.groups as usize, spec.heads as usize, spec.head_dim as usize);
    let (nq, nk) = (spec.nq as usize, spec.nk as usize);
    let mut out = vec![0.0; groups * nq * heads * d];
    let mut weights = vec![0.0f64; nk];
    for head in 0..groups * heads {
        for i in 0..nq {
            let mut top = f64::NEG_INFINITY;
            for (j, weight) in weights.iter_mut().enumerate() {
                *weight = 0.0;
                for c in 0..d {
                    *weight += f64::from(q[(head * nq + i) * d + c]) * f64::from(k[(head * nk + j) * d + c]);
                }
                top = top.max(*weight);
            }
            let mut sum = 0.0;
            for weight in &mut weights {
                *weight = (*weight - top).exp();
                sum += *weight;
            }
            for c in 0..d {
                let mut total = 0.0;
                for (j, weight) in weights.iter().enumerate() {
                    total += weight * f64::from(v[(head * nk + j) * d + c]);
                }
                out[(head / heads * nq + i) * heads * d + head % heads * d + c] = (total / sum) as f32;
            }
        }
    }
    out
}
