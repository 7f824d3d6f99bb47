//! Oracle of `splat`.

use crate::splat::Splat;

/// Shares fall from this at the centre of a disc to 1 at its edge.
const MOST: f64 = 15.0;
/// The samples of a pixel, from its centre.
const SAMPLES: [[f64; 2]; 4] = [[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]];

/// A disc in the picture.
struct Disc {
    centre: [f64; 2],
    radius: f64,
    z: f64,
    thickness: f64,
    colour: [f64; 3],
}

/// The picture `[height, width, 4]`. `view` is made by [`crate::splat::view`]. Which of the points below a quarter of a pixel are drawn
/// is not part of it: no such points may be given.
///
/// # Panics
/// On a disc that would be thinned.
#[must_use]
pub fn splat(spec: &Splat, points: &[f32], sizes: &[f32], colours: &[u32], view: &[f32]) -> Vec<f32> {
    let view: Vec<f64> = view.iter().map(|v| f64::from(*v)).collect();
    let mut discs = Vec::new();
    for i in 0..spec.n as usize {
        let point: [f64; 3] = std::array::from_fn(|c| f64::from(points[3 * i + c]));
        let row = |r: usize| (0..3).map(|c| view[4 * r + c] * point[c]).sum::<f64>() + view[4 * r + 3];
        let z = row(2);
        if !z.is_finite() || z <= view[17] || !(row(0).is_finite() && row(1).is_finite()) {
            continue;
        }
        let (u, v) = (row(0) / z, row(1) / z);
        let centre = [view[12] * u + view[13] * v + view[14], view[15] * v + view[16]];
        let size = f64::from(sizes[i]);
        let radius = if size < 0.0 { -size } else { view[12].max(view[15]) * size / z };
        assert!(size < 0.0 || radius >= 0.25, "BUG: the oracle does not thin: radius {radius}");
        discs.push(Disc {
            centre,
            radius: radius.clamp(0.7, f64::from(spec.largest)),
            z,
            thickness: if size < 0.0 { 0.0 } else { size / 2.0 },
            colour: [0, 8, 16].map(|shift| f64::from(colours[i] >> shift & 255)),
        });
    }
    let mut y = Vec::new();
    for row in 0..spec.height {
        for column in 0..spec.width {
            let place = SAMPLES.map(|[x, y]| [f64::from(column) + 0.5 + x, f64::from(row) + 0.5 + y]);
            let (mut cover, mut shares, mut sum) = (0.0, 0.0, [0.0; 3]);
            for sample in place {
                let apart = |disc: &Disc| {
                    let [x, y] = [0, 1].map(|axis| sample[axis] - disc.centre[axis]);
                    x * x + y * y
                };
                let here = discs.iter().filter(|disc| apart(disc) <= disc.radius * disc.radius);
                let front = here.clone().map(|disc| disc.z).fold(f64::INFINITY, f64::min);
                cover += if front.is_finite() { 0.25 } else { 0.0 };
                for disc in here.filter(|disc| disc.z <= front * (1.0 + view[18]) + disc.thickness) {
                    let share = (MOST - (MOST - 1.0) * apart(disc) / (disc.radius * disc.radius)).floor();
                    shares += share;
                    (0..3).for_each(|c| sum[c] += share * disc.colour[c]);
                }
            }
            for c in 0..4 {
                let colour = if c == 3 { 1.0 } else { sum[c] / f64::max(shares, 1.0) / 255.0 };
                y.push((cover * colour + (1.0 - cover) * view[20 + c]) as f32);
            }
        }
    }
    y
}
