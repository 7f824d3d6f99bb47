//! Where a window shows a place of the world.

use omnix_geometry::{Camera, PixelCentre, project};

/// Distance to the pixel where a point goes on, at most, in parts of the depth.
pub(super) const NEAR: f32 = 0.02;
/// And in pixels.
pub(super) const FOOTPRINT: f32 = 1.5;
/// Pixels around the projected place that are looked at: networks that do not agree with themselves put their points some pixels away.
const AROUND: i64 = 6;

/// What a window sees in an image, in its own world.
pub(super) struct View {
    pub(super) surface: Vec<f32>,
    pub(super) camera: Camera,
    pub(super) size: [usize; 2],
}

impl View {
    pub(super) fn point(&self, [x, y]: [u32; 2]) -> [f32; 3] {
        let at = 3 * (y as usize * self.size[1] + x as usize);
        [self.surface[at], self.surface[at + 1], self.surface[at + 2]]
    }

    /// The pixel that shows what is nearest to a position, and how far that is in parts of the depth; none where nothing near is shown.
    pub(super) fn nearest(&self, position: [f32; 3]) -> Option<(f32, [u32; 2])> {
        let [u, v, z] = project(position, &self.camera, PixelCentre::Whole);
        let [height, width] = self.size.map(|side| side as i64);
        let inside = z > 0.0 && u >= -0.5 && v >= -0.5 && u < width as f32 - 0.5 && v < height as f32 - 0.5;
        if !inside {
            return None;
        }
        let (x, y) = (u.round() as i64, v.round() as i64);
        let around = |centre: i64, side: i64| (centre - AROUND).max(0)..(centre + AROUND + 1).min(side);
        let pixels = around(y, height).flat_map(|y| around(x, width).map(move |x| [x as u32, y as u32]));
        let squared = |pixel: [u32; 2]| {
            let found = self.point(pixel);
            (0..3).map(|i| (found[i] - position[i]).powi(2)).sum::<f32>()
        };
        let (square, pixel) = pixels
            .map(|pixel| (squared(pixel), pixel))
            .filter(|(d, _)| d.is_finite())
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let off = square.sqrt() / z;
        (off <= NEAR + FOOTPRINT / self.camera.intrinsics[0][0]).then_some((off, pixel))
    }
}
