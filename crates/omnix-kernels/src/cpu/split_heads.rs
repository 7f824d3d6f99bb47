//! Oracle of `split_heads`.

use crate::split_heads::{HeadLayout, SplitHeads};

/// Splits `x[groups · tokens, x_stride]` into padded heads, in f64; `norm` is weight and bias, `table` the RoPE
/// rows of `head_dim` numbers, both as the specification asks for them.
#[must_use]
pub fn split_heads(spec: &SplitHeads, x: &[f32], norm: Option<(&[f32], &[f32])>, table: Option<&[f32]>) -> Vec<f32> {
    let (groups, tokens, heads) = (spec.groups as usize, spec.tokens as usize, spec.heads as usize);
    let d = spec.head_dim as usize;
    let (tokens_pad, dp) = (tokens.div_ceil(32) * 32, d.div_ceil(32) * 32);
    let mut y = vec![0.0; groups * heads * tokens_pad * dp];
    for g in 0..groups {
        for h in 0..heads {
            for t in 0..tokens {
                let from = (g * tokens + t) * spec.x_stride as usize + spec.x_offset as usize + h * d;
                let mut v: Vec<f64> = x[from..from + d].iter().map(|v| f64::from(*v)).collect();
                if let (Some(eps), Some((weight, bias))) = (spec.norm, norm) {
                    let mean = v.iter().sum::<f64>() / d as f64;
                    let variance = v.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / d as f64;
                    for j in 0..d {
                        v[j] = (v[j] - mean) / (variance + f64::from(eps)).sqrt() * f64::from(weight[j])
                            + f64::from(bias[j]);
                    }
                }
                if let (Some(rows), Some(table)) = (spec.rope_rows, table) {
                    v = turn(&v, &table[t % rows as usize * d..][..d]);
                }
                for (j, v) in v.iter().enumerate() {
                    let head = (g * heads + h) * tokens_pad * dp;
                    let at = match spec.layout {
                        HeadLayout::Rows => t * dp + j,
                        HeadLayout::KeyBlocks => (t / 32 * dp + j) * 32 + t % 32,
                    };
                    y[head + at] = (v * f64::from(spec.scale)) as f32;
                }
            }
        }
    }
    y
}

/// RoPE of one head with one table row: D/2 cosines, D/2 sines.
fn turn(v: &[f64], row: &[f32]) -> Vec<f64> {
    let (half, quarter) = (v.len() / 2, v.len() / 4);
    let mut out = v.to_vec();
    for axis in 0..2 {
        for j in 0..quarter {
            let (a, b) = (axis * half + j, axis * half + j + quarter);
            let (cosine, sine) = (f64::from(row[axis * quarter + j]), f64::from(row[half + axis * quarter + j]));
            out[a] = v[a] * cosine - v[b] * sine;
            out[b] = v[b] * cosine + v[a] * sine;
        }
    }
    out
}
