//! What the still and the moving `scene.glb` share: where the scene's origin is, and the lines of its cameras.

use glam::{DMat3, DVec3};

use super::{camera::Camera, colour, sample::percentile};

/// The points' median, and how far before their centres cameras are drawn: 0.03 times the diagonal of the 5..95 % box.
pub(super) fn placement(positions: &[DVec3]) -> (DVec3, f64) {
    let axes = sorted_axes(positions);
    let at = |p: f32| DVec3::from_array(std::array::from_fn(|a| percentile(&axes[a], p).map_or(0.0, f64::from)));
    let diagonal = (at(95.0) - at(5.0)).length();
    // A single point or none has no box; the cameras must not vanish with it.
    (at(50.0), if diagonal > 0.0 { 0.03 * diagonal } else { 0.03 })
}

fn sorted_axes(positions: &[DVec3]) -> [Vec<f32>; 3] {
    std::array::from_fn(|axis| {
        let mut values: Vec<f32> = positions.iter().map(|p| p[axis] as f32).collect();
        values.sort_unstable_by(f32::total_cmp);
        values
    })
}

/// World-to-camera as rows of `[R|t]`.
pub(super) fn rows(camera: Camera) -> [[f64; 4]; 3] {
    let t = camera.to_camera(DVec3::ZERO);
    let r = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::Z);
    std::array::from_fn(|i| {
        let column = |j: usize| (camera.to_camera(r.col(j)) - t)[i];
        [column(0), column(1), column(2), t[i]]
    })
}

/// Ends of eight segments in camera axes (OpenCV): the centre to the picture's corner pixels at a distance, and their rectangle.
pub(super) fn frustum(camera: Camera, (width, height): (u32, u32), distance: f64) -> [DVec3; 16] {
    let (right, bottom) = (f64::from(width) - 1.0, f64::from(height) - 1.0);
    let corners = [(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)].map(|(u, v)| camera.ray(u, v) * distance);
    std::array::from_fn(|i| match i % 4 {
        0 => DVec3::ZERO,
        3 => corners[(i / 4 + 1) % 4],
        _ => corners[i / 4],
    })
}

/// The colour of camera `i` of `count`.
pub(super) fn camera_colour(i: usize, count: usize) -> [u8; 3] {
    colour::hsv((i as f64 + 0.5) / count as f64, 0.85, 0.95)
}
