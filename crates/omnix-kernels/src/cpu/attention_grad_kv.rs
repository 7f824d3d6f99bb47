//! Oracle of `attention_grad_kv`.

use crate::attention::Attention;

/// Gradients of keys and values in f64 over unpadded head-major `q` and `g` `[groups][heads][nq][D]`, `k` and `v`
/// `[groups][heads][nk][D]`; `g` is the gradient of the output. Both results are `[groups][heads][nk][D]`.
#[must_use]
pub fn attention_grad_kv(spec: &Attention, q: &[f32], k: &[f32], v: &[f32], g: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
    let (nq, nk) = (spec.nq as usize, spec.nk as usize);
    let mut dk = vec![0.0f64; heads * nk * d];
    let mut dv = vec![0.0f64; heads * nk * d];
    let mut weights = vec![0.0f64; nk];
    let mut reached = vec![0.0f64; nk];
    for (head, i) in (0..heads).flat_map(|head| (0..nq).map(move |i| (head, i))) {
        let query = (head * nq + i) * d;
        let mut top = f64::NEG_INFINITY;
        for j in 0..nk {
            let key = (head * nk + j) * d;
            (weights[j], reached[j]) = (0.0, 0.0);
            for c in 0..d {
                weights[j] += f64::from(q[query + c]) * f64::from(k[key + c]);
                reached[j] += f64::from(g[query + c]) * f64::from(v[key + c]);
            }
            top = top.max(weights[j]);
        }
        let sum: f64 = weights.iter().map(|s| (s - top).exp()).sum();
        weights.iter_mut().for_each(|s| *s = (*s - top).exp() / sum);
        let delta: f64 = weights.iter().zip(&reached).map(|(w, r)| w * r).sum();
        for j in 0..nk {
            let key = (head * nk + j) * d;
            for c in 0..d {
                dk[key + c] += weights[j] * (reached[j] - delta) * f64::from(q[query + c]);
                dv[key + c] += weights[j] * f64::from(g[query + c]);
            }
        }
    }
    let round = |sums: Vec<f64>| sums.into_iter().map(|v| v as f32).collect();
    (round(dk), round(dv))
}
