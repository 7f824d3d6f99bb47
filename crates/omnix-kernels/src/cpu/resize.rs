//! Oracle of `resize`.

use crate::resize::{Corners, Filter, Resize};

/// The source coordinate of output `o`.
pub(super) fn coordinate(corners: Corners, n_in: u32, n_out: u32, rows: bool, o: usize) -> f64 {
    let (n_in, n_out, o) = (f64::from(n_in), f64::from(n_out), o as f64);
    match corners {
        Corners::Align if n_out == 1.0 => 0.0,
        Corners::Align => o * (n_in - 1.0) / (n_out - 1.0),
        Corners::HalfPixel => (o + 0.5) * n_in / n_out - 0.5,
        Corners::HalfPixelScaled { rows: r, columns: c } => {
            let scale = if rows { r } else { c };
            (o + 0.5) * f64::from(scale.num) / f64::from(scale.den) - 0.5
        }
    }
}

/// Cells and weights of one axis at `coordinate`; cells are on the map.
pub(super) fn taps(filter: Filter, coordinate: f64, n: u32) -> Vec<(usize, f64)> {
    let on_map = |cell: f64| cell.clamp(0.0, f64::from(n) - 1.0) as usize;
    match filter {
        Filter::Bilinear => {
            let at = coordinate.max(0.0);
            let t = at - at.floor();
            vec![(on_map(at.floor()), 1.0 - t), (on_map(at.floor() + 1.0), t)]
        }
        Filter::Bicubic => {
            let a = -0.75;
            let keys = |x: f64| match x.abs() {
                x if x <= 1.0 => (a + 2.0) * x.powi(3) - (a + 3.0) * x.powi(2) + 1.0,
                x if x < 2.0 => a * (x.powi(3) - 5.0 * x.powi(2) + 8.0 * x - 4.0),
                _ => 0.0,
            };
            let cells = (-1..=2).map(|i| coordinate.floor() + f64::from(i));
            cells.map(|cell| (on_map(cell), keys(coordinate - cell))).collect()
        }
    }
}

/// `y[f, oy, ox, c] = Σ_taps w_y w_x x[f, iy, ix, c] + code`, the code as in [`crate::resize`]; it is read where the specification has
/// it.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn resize(spec: &Resize, x: &[f32], code: &[f32]) -> Vec<f32> {
    let [hi, wi, ho, wo, c] = [spec.hi, spec.wi, spec.ho, spec.wo, spec.c].map(|n| n as usize);
    let mut y = Vec::with_capacity(spec.frames as usize * ho * wo * c);
    for f in 0..spec.frames as usize {
        for oy in 0..ho {
            let rows = taps(spec.filter, coordinate(spec.corners, spec.hi, spec.ho, true, oy), spec.hi);
            for ox in 0..wo {
                let columns = taps(spec.filter, coordinate(spec.corners, spec.wi, spec.wo, false, ox), spec.wi);
                for channel in 0..c {
                    let half = c / 2;
                    let place = if channel < half { ox * half + channel } else { (wo + oy) * half + channel - half };
                    let mut sum = if spec.code { f64::from(code[place]) } else { 0.0 };
                    for &(iy, wy) in &rows {
                        for &(ix, wx) in &columns {
                            sum += wy * wx * f64::from(x[((f * hi + iy) * wi + ix) * c + channel]);
                        }
                    }
                    y.push(sum as f32);
                }
            }
        }
    }
    y
}
