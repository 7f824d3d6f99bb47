//! How large the discs of an image's points are, so that they close the surface they lie on, and which points lie on none.
//!
//! A point is joined to a neighbour in the image if the surface between them is seen at a slope of at most [`STEEPEST`]: then their
//! depths differ by little. A disc reaches to the middle between its point and the farther of its joined neighbours along each axis, with
//! some overlap. A point that is joined to no neighbour along one of the axes hangs between a front and what is behind it, as
//! blurred edges of depth do, and is left out.

/// Depth gained for each unit across, above which two neighbours are not of one surface: a floor seen at less than 3 degrees.
const STEEPEST: f32 = 20.0;
/// Radius of a disc for a distance of neighbours: half the diagonal of a square, and some overlap.
const OVERLAP: f32 = 0.75;
/// Largest radius, in distances of pixels at the point's depth: discs face the camera, and large ones would stick out of a surface.
const LARGEST: f32 = 3.0;

/// Radii of the discs of an image's points, row by row, in units of the world; 0 where there is no point or it is left out. `depth` is along
/// the image's own camera of focal length `focal`, in pixels.
pub(super) fn radii(positions: &[[f32; 3]], depth: &[f32], [width, height]: [usize; 2], focal: f32) -> Vec<f32> {
    let mut radii = vec![0.0; positions.len()];
    let valid = |i: usize| depth[i].is_finite() && depth[i] > 0.0 && positions[i].iter().all(|v| v.is_finite());
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            if !valid(i) {
                continue;
            }
            // Distance to a neighbour that is joined.
            let joined = |j: usize| {
                let step = (depth[i] - depth[j]).abs();
                let across = depth[i].min(depth[j]) / focal;
                (valid(j) && step <= STEEPEST * across).then(|| distance(positions[i], positions[j]))
            };
            let along = |before: Option<usize>, after: Option<usize>| {
                let near = before.and_then(joined).into_iter().chain(after.and_then(joined)).reduce(f32::max);
                // An image of one row or column has no neighbours to be joined to.
                if before.or(after).is_none() { Some(0.0) } else { near }
            };
            let columns = along((x > 0).then(|| i - 1), (x + 1 < width).then(|| i + 1));
            let rows = along((y > 0).then(|| i - width), (y + 1 < height).then(|| i + width));
            if let (Some(columns), Some(rows)) = (columns, rows) {
                let pixel = depth[i] / focal;
                radii[i] = (OVERLAP * columns.max(rows)).clamp(OVERLAP * pixel, LARGEST * pixel);
            }
        }
    }
    radii
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a depth map seen from the origin.
    fn seen(size: [usize; 2], focal: f32, depth: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        let [width, height] = size;
        let depth: Vec<f32> = (0..width * height).map(|i| depth(i % width, i / width)).collect();
        let at = |i: usize| [(i % width) as f32 - 5.0, (i / width) as f32 - 5.0, focal].map(|v| v * depth[i] / focal);
        let positions: Vec<[f32; 3]> = (0..depth.len()).map(at).collect();
        radii(&positions, &depth, size, focal)
    }

    #[test]
    fn a_wall_has_discs_of_a_pixel() {
        for radius in seen([10, 8], 100.0, |_, _| 2.0) {
            assert!((radius - OVERLAP * 0.02).abs() < 1e-5, "{radius}");
        }
        assert_eq!(seen([1, 1], 100.0, |_, _| 2.0), [OVERLAP * 0.02]);
    }

    #[test]
    fn a_slanted_wall_has_larger_discs() {
        // Three units deeper for each unit across.
        let slanted = seen([10, 8], 100.0, |x, _| 2.0 / (1.0 - 0.03 * (x as f32 - 5.0)));
        assert!(slanted.iter().all(|r| *r > 0.0) && slanted[35] > 2.0 * OVERLAP * 0.02, "{slanted:?}");
    }

    #[test]
    fn what_hangs_between_two_surfaces_is_left_out() {
        // A near wall, a blurred edge of one column, a far wall, and no depth at all.
        let radii = seen([10, 8], 100.0, |x, y| match (x, y) {
            (9, 7) => f32::NAN,
            (0..5, _) => 1.0,
            (5, _) => 2.0,
            _ => 4.0,
        });
        for y in 0..8 {
            assert_eq!(radii[y * 10 + 5], 0.0, "row {y}");
            assert!(radii[y * 10 + 4] > 0.0 && radii[y * 10 + 6] > 0.0, "row {y}");
        }
        assert_eq!(radii[79], 0.0);
    }
}
