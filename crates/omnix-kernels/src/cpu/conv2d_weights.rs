//! Oracle of `conv2d_weights`.

use crate::conv2d_weights::Conv2dWeights;

/// `dw[o, c, ky, kx] = Σ dy[f, oy, ox, o] · x[f, oy s + ky − pad, ox s + kx − pad, c]` and `db[o] = Σ dy[f, oy, ox, o]`, in f64.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn conv2d_weights(spec: &Conv2dWeights, x: &[f32], dy: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let [ho, wo] = spec.output().map(|n| n as usize);
    let (hi, wi, ci, co) = (spec.hi as usize, spec.wi as usize, spec.ci as usize, spec.co as usize);
    let [kh, kw] = spec.kernel.map(|n| n as usize);
    let (stride, padding) = (spec.stride as usize, spec.padding as usize);
    let mut dw = vec![0.0f64; co * ci * kh * kw];
    let mut db = vec![0.0f64; co];
    for f in 0..spec.frames as usize {
        for (oy, ox) in (0..ho).flat_map(|oy| (0..wo).map(move |ox| (oy, ox))) {
            for o in 0..co {
                let d = f64::from(dy[((f * ho + oy) * wo + ox) * co + o]);
                db[o] += d;
                for (ky, kx) in (0..kh).flat_map(|ky| (0..kw).map(move |kx| (ky, kx))) {
                    let (iy, ix) = (oy * stride + ky, ox * stride + kx);
                    if iy < padding || iy - padding >= hi || ix < padding || ix - padding >= wi {
                        continue;
                    }
                    let pixel = (f * hi + iy - padding) * wi + ix - padding;
                    for c in 0..ci {
                        dw[((o * ci + c) * kh + ky) * kw + kx] += d * f64::from(x[pixel * ci + c]);
                    }
                }
            }
        }
    }
    let round = |sums: Vec<f64>| sums.into_iter().map(|v| v as f32).collect();
    (round(dw), round(db))
}
