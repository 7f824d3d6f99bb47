//! Layer norm, columns of tokens as heads, and attention.

use omnix_graph::ops::{Attention, LayerNorm, SplitHeads};

use super::Run;
use super::pointwise::activate;

impl Run<'_> {
    pub(super) fn layer_norm(&self, op: &LayerNorm) -> Vec<f64> {
        let affine = [op.weight, op.bias].map(|v| v.map(|v| self.get(v)));
        let rows = self.get(op.x).chunks_exact(self.width(op.x));
        let normed = rows.flat_map(|row| normalise(row, affine, op.eps));
        normed.map(|v| activate(op.act, v)).collect()
    }

    pub(super) fn split_heads(&self, op: &SplitHeads) -> Vec<f64> {
        let (x, width, d) = (self.get(op.x), self.width(op.x), op.head_dim);
        let mut y = Vec::with_capacity(op.groups * op.heads * op.tokens * d);
        for group in 0..op.groups {
            for head in 0..op.heads {
                for token in 0..op.tokens {
                    let start = (group * op.tokens + token) * width + op.offset + head * d;
                    let mut row = x[start..start + d].to_vec();
                    if let Some((w, b, eps)) = op.norm {
                        row = normalise(&row, [Some(self.get(w)), Some(self.get(b))], eps);
                    }
                    if let Some(table) = op.rope {
                        let rows = self.dims(table)[0];
                        rotate(&mut row, &self.get(table)[token % rows * d..][..d]);
                    }
                    y.extend(row.iter().map(|v| v * f64::from(op.scale)));
                }
            }
        }
        y
    }

    pub(super) fn attention(&self, op: &Attention) -> Vec<f64> {
        let (q, k, v, d) = (self.get(op.q), self.get(op.k), self.get(op.v), op.head_dim);
        let mut y = vec![0.0; op.groups * op.queries * op.heads * d];
        for group in 0..op.groups {
            for head in 0..op.heads {
                let start = |tokens: usize| (group * op.heads + head) * tokens * d;
                let keys = &k[start(op.keys)..][..op.keys * d];
                let values = &v[start(op.keys)..][..op.keys * d];
                for query in 0..op.queries {
                    let row = &q[start(op.queries) + query * d..][..d];
                    let dot = |key: &[f64]| row.iter().zip(key).map(|(a, b)| a * b).sum::<f64>();
                    let scores: Vec<f64> = keys.chunks_exact(d).map(dot).collect();
                    let most = scores.iter().copied().fold(f64::MIN, f64::max);
                    let weights: Vec<f64> = scores.iter().map(|s| (s - most).exp()).collect();
                    let total: f64 = weights.iter().sum();
                    let out = &mut y[((group * op.queries + query) * op.heads + head) * d..][..d];
                    for (weight, value) in weights.iter().zip(values.chunks_exact(d)) {
                        out.iter_mut().zip(value).for_each(|(o, v)| *o += weight / total * v);
                    }
                }
            }
        }
        y
    }
}

/// A row with mean 0 and variance 1, then times weight plus bias.
fn normalise(row: &[f64], [weight, bias]: [Option<&[f64]>; 2], eps: f32) -> Vec<f64> {
    let n = row.len() as f64;
    let mean = row.iter().sum::<f64>() / n;
    let variance = row.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    let scale = 1.0 / (variance + f64::from(eps)).sqrt();
    let affine = |(i, v): (usize, &f64)| (v - mean) * scale * weight.map_or(1.0, |w| w[i]) + bias.map_or(0.0, |b| b[i]);
    row.iter().enumerate().map(affine).collect()
}

/// RoPE by a row of cosines then sines, each of half the width.
fn rotate(row: &mut [f64], table: &[f64]) {
    let (d, q) = (row.len(), row.len() / 4);
    for angle in 0..d / 2 {
        let (cos, sin) = (table[angle], table[d / 2 + angle]);
        let first = angle / q * (d / 2) + angle % q;
        let (a, b) = (row[first], row[first + q]);
        (row[first], row[first + q]) = (a * cos - b * sin, b * cos + a * sin);
    }
}
