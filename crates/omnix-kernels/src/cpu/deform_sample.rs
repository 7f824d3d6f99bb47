//! Oracle of `deform_sample`.

use crate::deform_sample::DeformSample;

/// Host arrays in the order of the kernel's arguments.
#[derive(Clone, Copy, Debug)]
pub struct Sampled<'a> {
    /// `[n, levels, points, 2]`.
    pub offsets: &'a [f32],
    /// `[n, levels, points]`.
    pub weights: &'a [f32],
    /// `[n]`, read where the specification says so.
    pub pixels: &'a [u32],
    /// `[levels, T, L, 9]`.
    pub field: &'a [f32],
    /// `[L]`.
    pub mask: &'a [f32],
}

/// tau `[n, 9 T + 1]`.
#[must_use]
pub fn deform_sample(spec: &DeformSample, data: &Sampled<'_>) -> Vec<f32> {
    let (width, times, points) = (spec.width as usize, spec.times as usize, spec.points as usize);
    let (hp, wp, levels) = (spec.hp as usize, spec.wp as usize, spec.levels as usize);
    let mut tau = Vec::new();
    for i in 0..spec.n as usize {
        let pixel = if spec.listed { data.pixels[i] as usize } else { i };
        let (px, py) = ((pixel % width) as f64, (pixel / width) as f64);
        let mut row = vec![0.0f64; times * 9 + 1];
        for k in 0..levels * points {
            let offset = &data.offsets[(i * levels * points + k) * 2..][..2];
            let weight = f64::from(data.weights[i * levels * points + k]);
            let coordinate = |place: f64, size: u32, offset: f32, cells: usize| {
                let reference = place / f64::from(size.max(2) - 1);
                (reference + f64::from(offset) / cells as f64).clamp(0.0, 1.0) * cells as f64 - 0.5
            };
            let x = coordinate(px, spec.width, offset[0], wp);
            let y = coordinate(py, spec.height, offset[1], hp);
            for cy in 0..hp {
                for cx in 0..wp {
                    let near = (1.0 - (x - cx as f64).abs()).max(0.0) * (1.0 - (y - cy as f64).abs()).max(0.0);
                    if near == 0.0 {
                        continue;
                    }
                    let cell = cy * wp + cx;
                    for (t, c) in (0..times).flat_map(|t| (0..9).map(move |c| (t, c))) {
                        let at = ((k / points * times + t) * hp * wp + cell) * 9 + c;
                        row[t * 9 + c] += weight * near * f64::from(data.field[at]);
                    }
                    row[times * 9] += weight * near * f64::from(data.mask[cell]);
                }
            }
        }
        tau.extend(row.iter().map(|v| *v as f32));
    }
    tau
}
