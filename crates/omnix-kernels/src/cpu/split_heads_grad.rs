//! Oracle of `split_heads_grad`.

use crate::split_heads_grad::SplitHeadsGrad;

/// Gradients of x (`dx[groups · tokens, dx_stride]`, columns that belong to no head keep `before`), weight and bias `[head_dim]`, in f64,
/// from `dy` in padded rows. `weight` and `table` as the specification asks for them; the last two are 0 without a norm.
#[must_use]
pub fn split_heads_grad(
    spec: &SplitHeadsGrad,
    x: &[f32],
    weight: &[f32],
    table: &[f32],
    dy: &[f32],
    before: f32,
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let heads_of = &spec.heads;
    let (groups, tokens, heads) = (heads_of.groups as usize, heads_of.tokens as usize, heads_of.heads as usize);
    let d = heads_of.head_dim as usize;
    let (tokens_pad, dp) = (tokens.div_ceil(32) * 32, d.div_ceil(32) * 32);
    let (x_stride, dx_stride) = (heads_of.x_stride as usize, spec.dx_stride as usize);
    let mut dx = vec![before; groups * tokens * dx_stride];
    let (mut d_weight, mut d_bias) = (vec![0.0f64; d], vec![0.0f64; d]);
    for (g, t) in (0..groups).flat_map(|g| (0..tokens).map(move |t| (g, t))) {
        for h in 0..heads {
            let from = ((g * heads + h) * tokens_pad + t) * dp;
            let mut u: Vec<f64> = dy[from..from + d].iter().map(|v| f64::from(*v)).collect();
            if let Some(rows) = heads_of.rope_rows {
                u = turn_back(&u, &table[t % rows as usize * d..][..d]);
            }
            u.iter_mut().for_each(|v| *v *= f64::from(heads_of.scale));
            if let Some(eps) = heads_of.norm {
                let at = (g * tokens + t) * x_stride + heads_of.x_offset as usize + h * d;
                let x: Vec<f64> = x[at..at + d].iter().map(|v| f64::from(*v)).collect();
                let mean = x.iter().sum::<f64>() / d as f64;
                let variance = x.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / d as f64;
                let deviation = (variance + f64::from(eps)).sqrt();
                let n: Vec<f64> = x.iter().map(|v| (v - mean) / deviation).collect();
                for j in 0..d {
                    d_weight[j] += u[j] * n[j];
                    d_bias[j] += u[j];
                    u[j] *= f64::from(weight[j]);
                }
                let plain = u.iter().sum::<f64>() / d as f64;
                let along = u.iter().zip(&n).map(|(u, n)| u * n).sum::<f64>() / d as f64;
                for j in 0..d {
                    u[j] = (u[j] - plain - n[j] * along) / deviation;
                }
            }
            let to = (g * tokens + t) * dx_stride + spec.dx_offset as usize + h * d;
            for (j, v) in u.iter().enumerate() {
                dx[to + j] = *v as f32;
            }
        }
    }
    let round = |sums: Vec<f64>| sums.into_iter().map(|v| v as f32).collect();
    (dx, round(d_weight), round(d_bias))
}

/// The rotation of one head with one table row (D/2 cosines, D/2 sines), transposed.
fn turn_back(v: &[f64], row: &[f32]) -> Vec<f64> {
    let (half, quarter) = (v.len() / 2, v.len() / 4);
    let mut out = v.to_vec();
    for axis in 0..2 {
        for j in 0..quarter {
            let (a, b) = (axis * half + j, axis * half + j + quarter);
            let (cosine, sine) = (f64::from(row[axis * quarter + j]), f64::from(row[half + axis * quarter + j]));
            out[a] = v[a] * cosine + v[b] * sine;
            out[b] = v[b] * cosine - v[a] * sine;
        }
    }
    out
}
