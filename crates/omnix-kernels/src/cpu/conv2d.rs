//! Oracle of `conv2d`.

use crate::conv2d::Conv2d;

/// `y = act(conv(pre(x)) + bias) + residual + residual2` with `w(k, o)` the weight of `k = (ky·kw + kx)·ci + c`;
/// what the specification leaves out is not read.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn conv2d(
    spec: &Conv2d,
    x: &[f32],
    w: &dyn Fn(usize, usize) -> f32,
    bias: &[f32],
    residual: &[f32],
    residual2: &[f32],
) -> Vec<f32> {
    let [ho, wo] = spec.output().map(|n| n as usize);
    let (hi, wi, ci, co) = (spec.hi as usize, spec.wi as usize, spec.ci as usize, spec.weights.n as usize);
    let [kh, kw] = spec.kernel.map(|n| n as usize);
    let (stride, padding) = (spec.stride as usize, spec.padding as usize);
    let mut y = Vec::with_capacity(spec.frames as usize * ho * wo * co);
    for f in 0..spec.frames as usize {
        for (oy, ox, o) in (0..ho).flat_map(|oy| (0..wo).flat_map(move |ox| (0..co).map(move |o| (oy, ox, o)))) {
            let mut sum = 0.0f64;
            for (ky, kx) in (0..kh).flat_map(|ky| (0..kw).map(move |kx| (ky, kx))) {
                let (iy, ix) = (oy * stride + ky, ox * stride + kx);
                if iy < padding || iy - padding >= hi || ix < padding || ix - padding >= wi {
                    continue;
                }
                let pixel = (f * hi + iy - padding) * wi + ix - padding;
                for c in 0..ci {
                    let value = f64::from(x[pixel * ci + c]);
                    let value = if spec.relu_input { value.max(0.0) } else { value };
                    sum += value * f64::from(w((ky * kw + kx) * ci + c, o));
                }
            }
            let at = y.len();
            sum = spec.act.apply(sum + if spec.bias { f64::from(bias[o]) } else { 0.0 });
            sum += if spec.residual { f64::from(residual[at]) } else { 0.0 };
            sum += if spec.residual2 { f64::from(residual2[at]) } else { 0.0 };
            y.push(sum as f32);
        }
    }
    y
}
