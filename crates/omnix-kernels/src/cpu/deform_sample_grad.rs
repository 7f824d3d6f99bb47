//! Oracle of `deform_sample_grad`, and of `deform_sample_grad_field`: one walk over all cells for each sampling point.

use crate::cpu::deform_sample::Sampled;
use crate::deform_sample::DeformSample;

/// The four gradients of a sampling.
#[derive(Clone, Debug)]
pub struct SampledGrad {
    /// Of the offsets `[n, levels, points, 2]`.
    pub offsets: Vec<f32>,
    /// Of the weights `[n, levels, points]`.
    pub weights: Vec<f32>,
    /// Of the field `[levels, T, L, 9]`.
    pub field: Vec<f32>,
    /// Of the mask `[L]`.
    pub mask: Vec<f32>,
}

/// How near x is to cell c, and the derivative of that: of a hat from c − 1 to c + 1, whose corners belong to what follows them.
fn hat(x: f64, c: f64) -> (f64, f64) {
    let d = x - c;
    match d {
        _ if (-1.0..0.0).contains(&d) => (1.0 + d, 1.0),
        _ if (0.0..1.0).contains(&d) => (1.0 - d, -1.0),
        _ => (0.0, 0.0),
    }
}

/// All gradients for dtau `[n, 9 T + 1]`.
#[must_use]
pub fn deform_sample_grad(spec: &DeformSample, data: &Sampled<'_>, dtau: &[f32]) -> SampledGrad {
    let (n, width, times, points) = (spec.n as usize, spec.width as usize, spec.times as usize, spec.points as usize);
    let (hp, wp, taps) = (spec.hp as usize, spec.wp as usize, spec.levels as usize * points);
    let mut offsets = vec![0.0f64; n * taps * 2];
    let mut weights = vec![0.0f64; n * taps];
    let mut field = vec![0.0f64; data.field.len()];
    let mut mask = vec![0.0f64; hp * wp];
    for i in 0..n {
        let pixel = if spec.listed { data.pixels[i] as usize } else { i };
        let g = &dtau[i * (times * 9 + 1)..][..times * 9 + 1];
        for k in 0..taps {
            let at = i * taps + k;
            let weight = f64::from(data.weights[at]);
            // The position in cells, and whether it follows the offset.
            let coordinate = |place: usize, size: u32, axis: usize, cells: usize| {
                let reference = place as f64 / f64::from(size.max(2) - 1);
                let wanted = reference + f64::from(data.offsets[at * 2 + axis]) / cells as f64;
                (wanted.clamp(0.0, 1.0) * cells as f64 - 0.5, f64::from((0.0..=1.0).contains(&wanted)))
            };
            let (x, follows_x) = coordinate(pixel % width, spec.width, 0, wp);
            let (y, follows_y) = coordinate(pixel / width, spec.height, 1, hp);
            for (cell, dmask) in mask.iter_mut().enumerate() {
                let (near_x, slope_x) = hat(x, (cell % wp) as f64);
                let (near_y, slope_y) = hat(y, (cell / wp) as f64);
                if slope_x * slope_y == 0.0 {
                    continue;
                }
                // What the cell holds, against the gradient of what is sampled.
                let mut product = f64::from(g[times * 9]) * f64::from(data.mask[cell]);
                *dmask += weight * near_x * near_y * f64::from(g[times * 9]);
                for (t, c) in (0..times).flat_map(|t| (0..9).map(move |c| (t, c))) {
                    let from = ((k / points * times + t) * hp * wp + cell) * 9 + c;
                    product += f64::from(g[t * 9 + c]) * f64::from(data.field[from]);
                    field[from] += weight * near_x * near_y * f64::from(g[t * 9 + c]);
                }
                weights[at] += near_x * near_y * product;
                offsets[at * 2] += weight * follows_x * slope_x * near_y * product;
                offsets[at * 2 + 1] += weight * follows_y * near_x * slope_y * product;
            }
        }
    }
    let narrow = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
    SampledGrad { offsets: narrow(offsets), weights: narrow(weights), field: narrow(field), mask: narrow(mask) }
}
