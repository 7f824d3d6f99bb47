//! Matrix products and convolutions, with what fusion moves into them.

use omnix_graph::Value;
use omnix_graph::graph::WeightForm;
use omnix_graph::ops::{Conv2d, Linear};

use super::Run;
use super::pointwise::activate;

impl Run<'_> {
    pub(super) fn linear(&self, op: &Linear) -> Vec<f64> {
        let (x, w, k) = (self.get(op.x), self.get(op.w), self.width(op.x));
        let dims = self.dims(op.w);
        let n = match op.form {
            WeightForm::Linear | WeightForm::ConvTransposeGradient => dims[0],
            WeightForm::ConvTranspose | WeightForm::LinearGradient => dims[1..].iter().product(),
            other => panic!("a layer of {other:?}"),
        };
        // Out channel and tap of a column or row that goes by (row, column, out).
        let tapped = |at: usize| at % dims[1] * (dims[2] * dims[3]) + at / dims[1];
        let place = |k0: usize, n0: usize| match op.form {
            WeightForm::Linear => n0 * k + k0,
            WeightForm::LinearGradient => k0 * n + n0,
            WeightForm::ConvTranspose => k0 * n + tapped(n0),
            _ => n0 * k + tapped(k0),
        };
        // As [k][n], so that the inner loop runs over neighbours.
        let table: Vec<f64> =
            (0..k).flat_map(|k0| (0..n).map(move |n0| (k0, n0))).map(|(k, n)| w[place(k, n)]).collect();
        let mut y = vec![0.0; x.len() / k * n];
        for (row, out) in x.chunks_exact(k).zip(y.chunks_exact_mut(n)) {
            for (v, weights) in row.iter().zip(table.chunks_exact(n)) {
                out.iter_mut().zip(weights).for_each(|(o, w)| *o += v * w);
            }
        }
        let [bias, gamma, residual] = [op.bias, op.gamma, op.residual].map(|v| v.map(|v| self.get(v)));
        for (i, v) in y.iter_mut().enumerate() {
            let column = i % n;
            // The bias of a transposed convolution is one for each out channel.
            let sum = *v + bias.map_or(0.0, |b| b[column % b.len()]);
            *v = activate(op.act, sum) * gamma.map_or(1.0, |g| g[column]) + residual.map_or(0.0, |r| r[i]);
        }
        y
    }

    pub(super) fn conv2d(&self, op: &Conv2d) -> Vec<f64> {
        let (x, w) = (self.get(op.x), self.get(op.w));
        let [frames, h, width, ci] = self.map_dims(op.x);
        let [first, second, kh, kw] = self.map_dims(op.w);
        // The gradient of a convolution is one with its kernel turned around, from its outputs to its inputs.
        let turned = op.form == WeightForm::ConvGradient;
        let co = if turned { second } else { first };
        let taps = kh * kw;
        let place = |t: usize, i: usize, o: usize| {
            if turned { (i * co + o) * taps + (taps - 1 - t) } else { (o * ci + i) * taps + t }
        };
        let side = |n: usize, k: usize| (n + 2 * op.padding - k) / op.stride + 1;
        let (ho, wo) = (side(h, kh), side(width, kw));
        let mut table = Vec::with_capacity(w.len());
        for t in 0..taps {
            for i in 0..ci {
                table.extend((0..co).map(|o| w[place(t, i, o)]));
            }
        }
        let mut y = vec![0.0; frames * ho * wo * co];
        for (pixel, out) in y.chunks_exact_mut(co).enumerate() {
            let (frame, oy, ox) = (pixel / (ho * wo), pixel / wo % ho, pixel % wo);
            for t in 0..taps {
                let (iy, ix) = (oy * op.stride + t / kw, ox * op.stride + t % kw);
                if iy < op.padding || ix < op.padding || iy - op.padding >= h || ix - op.padding >= width {
                    continue;
                }
                let from = &x[((frame * h + iy - op.padding) * width + ix - op.padding) * ci..][..ci];
                for (i, v) in from.iter().enumerate() {
                    let v = if op.relu_input { v.max(0.0) } else { *v };
                    let row = &table[(t * ci + i) * co..][..co];
                    out.iter_mut().zip(row).for_each(|(o, w)| *o += v * w);
                }
            }
        }
        let bias = op.bias.map(|b| self.get(b));
        let residuals: Vec<&[f64]> = op.residuals.iter().flatten().map(|r| self.get(*r)).collect();
        for (i, v) in y.iter_mut().enumerate() {
            let sum = *v + bias.map_or(0.0, |b| b[i % co]);
            *v = activate(op.act, sum) + residuals.iter().map(|r| r[i]).sum::<f64>();
        }
        y
    }

    /// The four dimensions of a map or of a kernel.
    pub(super) fn map_dims(&self, value: Value) -> [usize; 4] {
        <[usize; 4]>::try_from(self.dims(value)).unwrap_or_else(|dims| panic!("{dims:?} is no map"))
    }
}
