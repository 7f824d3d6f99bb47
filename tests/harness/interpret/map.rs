//! Maps at another height and width.

use omnix_graph::Value;
use omnix_graph::ops::{Corners, Filter, Resize};

use super::Run;

impl Run<'_> {
    pub(super) fn resize(&self, op: &Resize, y: Value) -> Vec<f64> {
        let [frames, h, w, c] = self.map_dims(op.x);
        let [_, ho, wo, _] = self.map_dims(y);
        let rows: Vec<_> = (0..ho).map(|o| taps(o, h, ho, op.filter, op.corners, true)).collect();
        let columns: Vec<_> = (0..wo).map(|o| taps(o, w, wo, op.filter, op.corners, false)).collect();
        let (data, mut y) = (self.get(op.x), vec![0.0; frames * ho * wo * c]);
        for (pixel, out) in y.chunks_exact_mut(c).enumerate() {
            let (frame, oy, ox) = (pixel / (ho * wo), pixel / wo % ho, pixel % wo);
            for (iy, wy) in &rows[oy] {
                for (ix, wx) in &columns[ox] {
                    let from = &data[((frame * h + iy) * w + ix) * c..][..c];
                    out.iter_mut().zip(from).for_each(|(o, v)| *o += wy * wx * v);
                }
            }
            if let Some(code) = op.code {
                let (table, half) = (self.get(code), c / 2);
                let [column, row] = [ox, wo + oy].map(|line| &table[line * half..][..half]);
                out.iter_mut().zip(column.iter().chain(row)).for_each(|(o, v)| *o += v);
            }
        }
        y
    }
}

/// Indices and weights of the source cells of output `o`.
fn taps(o: usize, from: usize, to: usize, filter: Filter, corners: Corners, rows: bool) -> Vec<(usize, f64)> {
    let o = o as f64;
    let src = match corners {
        Corners::Align if to == 1 => 0.0,
        Corners::Align => o * (from - 1) as f64 / (to - 1) as f64,
        Corners::HalfPixel => (o + 0.5) * from as f64 / to as f64 - 0.5,
        Corners::HalfPixelScaled { rows: r, columns: c } => {
            let scale = if rows { r } else { c };
            (o + 0.5) * f64::from(scale.num) / f64::from(scale.den) - 0.5
        }
    };
    let cell = |i: f64| i.clamp(0.0, (from - 1) as f64) as usize;
    let (floor, f) = (src.floor(), src - src.floor());
    match filter {
        Filter::Bilinear => vec![(cell(floor), 1.0 - f), (cell(floor + 1.0), f)],
        Filter::Bicubic => {
            const A: f64 = -0.75;
            let near = |x: f64| (A + 2.0) * x.powi(3) - (A + 3.0) * x.powi(2) + 1.0;
            let far = |x: f64| A * x.powi(3) - 5.0 * A * x.powi(2) + 8.0 * A * x - 4.0 * A;
            let weights = [far(1.0 + f), near(f), near(1.0 - f), far(2.0 - f)];
            weights.into_iter().enumerate().map(|(i, w)| (cell(floor + i as f64 - 1.0), w)).collect()
        }
    }
}
