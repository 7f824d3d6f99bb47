//! Oracle of `attention_grad_q`.

use crate::attention::Attention;

/// Gradient of the queries, and of each query the logarithm of its sum of exponentials and g · out, in f64 over unpadded head-major
/// `q` and `g` `[groups][heads][nq][D]`, `k` and `v` `[groups][heads][nk][D]`; `g` is the gradient of the output. The results are
/// `[groups][heads][nq][D]` and `[groups][heads][2][nq]`.
#[must_use]
pub fn attention_grad_q(spec: &Attention, q: &[f32], k: &[f32], v: &[f32], g: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
    let (nq, nk) = (spec.nq as usize, spec.nk as usize);
    let mut dq = vec![0.0; heads * nq * d];
    let mut facts = vec![0.0; heads * 2 * nq];
    let dot = |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum() };
    for head in 0..heads {
        for i in 0..nq {
            let row = (head * nq + i) * d..(head * nq + i + 1) * d;
            let key = |j: usize| (head * nk + j) * d..(head * nk + j + 1) * d;
            let scores: Vec<f64> = (0..nk).map(|j| dot(&q[row.clone()], &k[key(j)])).collect();
            let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = scores.iter().map(|s| (s - top).exp()).sum();
            let weights: Vec<f64> = scores.iter().map(|s| (s - top).exp() / sum).collect();
            let reached: Vec<f64> = (0..nk).map(|j| dot(&g[row.clone()], &v[key(j)])).collect();
            // g . out, out being the weighted sum of values.
            let delta: f64 = weights.iter().zip(&reached).map(|(w, r)| w * r).sum();
            for c in 0..d {
                let terms = (0..nk).map(|j| weights[j] * (reached[j] - delta) * f64::from(k[(head * nk + j) * d + c]));
                dq[(head * nq + i) * d + c] = terms.sum::<f64>() as f32;
            }
            facts[head * 2 * nq + i] = (top + sum.ln()) as f32;
            facts[(head * 2 + 1) * nq + i] = delta as f32;
        }
    }
    (dq, facts)
}
