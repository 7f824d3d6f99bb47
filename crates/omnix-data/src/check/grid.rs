//! Depth between pixels, the pixels that a check looks at, and order statistics.

use crate::Sample;

/// Pixels per image that are looked at, at most, roughly.
const PIXELS: usize = 1500;
/// Inverse depths that differ by more than this share are on two surfaces.
const ONE_SURFACE: f64 = 1.1;

/// The pixels of an image that are looked at: of a large one a regular grid of them.
pub(super) fn chosen(sample: &Sample) -> impl Iterator<Item = usize> + Clone + use<> {
    let [width, height] = sample.size().map(|side| side as usize);
    let step = ((sample.pixels() as f64 / PIXELS as f64).sqrt().ceil() as usize).max(1);
    let rows = (step / 2..height).step_by(step);
    rows.flat_map(move |row| (step / 2..width).step_by(step).map(move |column| row * width + column))
}

/// What a depth map says at image coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum At {
    /// Outside of the image.
    Outside,
    /// Unknown, or between two surfaces.
    Unclear,
    /// 1/depth, linear between the four centres of pixels about: exact on planes.
    Inverse(f64),
}

/// Inverse depth at image coordinates (u, v).
pub(super) fn at(depth: &[f32], [width, height]: [usize; 2], [u, v]: [f64; 2]) -> At {
    let offset = crate::PIXEL.offset();
    if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
        return At::Outside;
    }
    let place = |x: f64, size: usize| {
        let x = (x - offset).clamp(0.0, (size - 1) as f64);
        let low = (x as usize).min(size.saturating_sub(2));
        (low, (low + 1).min(size - 1), x - low as f64)
    };
    let ((left, right, across), (top, bottom, down)) = (place(u, width), place(v, height));
    let inverse = |row: usize, column: usize| 1.0 / f64::from(depth[row * width + column]);
    let four = [inverse(top, left), inverse(top, right), inverse(bottom, left), inverse(bottom, right)];
    let (low, high) = four.iter().fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(*v), high.max(*v)));
    if four.iter().any(|v| v.is_nan()) || high > low * ONE_SURFACE {
        return At::Unclear;
    }
    let line = |a: f64, b: f64| a + (b - a) * across;
    let (above, below) = (line(four[0], four[1]), line(four[2], four[3]));
    At::Inverse(above + (below - above) * down)
}

/// The value of rank `share * (n - 1)`, rounded; 0 of none. Sorts the list.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(rank).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_exact_and_edges_unclear() {
        // 1/z = 0.1 + 0.01 u + 0.02 v at the centres.
        let size = [4, 3];
        let inverse = |u: f64, v: f64| 0.1 + 0.01 * u + 0.02 * v;
        let mut depth: Vec<f32> =
            (0..12).map(|k| (1.0 / inverse((k % 4) as f64 + 0.5, (k / 4) as f64 + 0.5)) as f32).collect();
        for [u, v] in [[1.5, 1.5], [2.2, 0.9], [3.1, 2.4]] {
            let wide = depth.iter().map(|z| z * 10.0).collect::<Vec<_>>();
            let At::Inverse(found) = at(&wide, size, [u, v]) else {
                // Neighbours of this steep plane differ by more than a tenth nearer to the corner.
                continue;
            };
            assert!((found * 10.0 - inverse(u, v)).abs() < 1e-6, "{found}");
        }
        assert_eq!(at(&depth, size, [4.0, 1.0]), At::Outside);
        assert_eq!(at(&depth, size, [f64::NAN, 1.0]), At::Outside);
        depth[5] = f32::NAN;
        assert_eq!(at(&depth, size, [1.5, 1.5]), At::Unclear);
        assert_eq!(at(&[2.0], [1, 1], [0.3, 0.9]), At::Inverse(0.5));
    }

    #[test]
    fn quantiles_are_ranks() {
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(&mut [], 0.5), 0.0);
    }
}
