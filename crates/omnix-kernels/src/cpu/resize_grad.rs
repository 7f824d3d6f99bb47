//! Oracle of `resize_grad`.

use super::resize::{coordinate, taps};
use crate::resize_grad::ResizeGrad;

/// Every output's gradient `dy[f, oy, ox, c]` handed to the pixels it was read from, with their weights, in f64.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn resize_grad(spec: &ResizeGrad, dy: &[f32]) -> Vec<f32> {
    let spec = &spec.resize;
    let [hi, wi, ho, wo, c] = [spec.hi, spec.wi, spec.ho, spec.wo, spec.c].map(|n| n as usize);
    let mut dx = vec![0.0f64; spec.frames as usize * hi * wi * c];
    for f in 0..spec.frames as usize {
        for oy in 0..ho {
            let rows = taps(spec.filter, coordinate(spec.corners, spec.hi, spec.ho, true, oy), spec.hi);
            for ox in 0..wo {
                let columns = taps(spec.filter, coordinate(spec.corners, spec.wi, spec.wo, false, ox), spec.wi);
                for channel in 0..c {
                    let gradient = f64::from(dy[((f * ho + oy) * wo + ox) * c + channel]);
                    for &(iy, wy) in &rows {
                        for &(ix, wx) in &columns {
                            dx[((f * hi + iy) * wi + ix) * c + channel] += wy * wx * gradient;
                        }
                    }
                }
            }
        }
    }
    dx.into_iter().map(|v| v as f32).collect()
}
