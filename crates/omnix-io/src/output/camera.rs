//! One image's camera, as exports need it: unprojection, centre, orientation. Sums in f64.
//!
//! World point of pixel (u, v) at depth d: `c2w * (d * K^-1 (u, v, 1))` with whole numbers u, v, as the reference's exports do.

use glam::{DMat3, DQuat, DVec3};

use super::frame::FrameResult;
use crate::IoError;

/// A camera with everything inverted once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    /// World to camera.
    rotation: DMat3,
    translation: DVec3,
    /// Camera to world.
    back: DMat3,
    /// Inverse intrinsics.
    rays: DMat3,
}

/// A coloured point of the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) position: [f32; 3],
    pub(super) colour: [u8; 3],
    pub(super) confidence: f32,
}

fn rows3(m: [[f32; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&m.map(|row| row.map(f64::from))).transpose()
}

impl Camera {
    /// The camera of a result, or an error that names what is missing.
    pub(super) fn of(frame: &FrameResult<'_>, export: &'static str) -> Result<Self, IoError> {
        let missing = |missing| IoError::MissingField { export, missing, index: frame.index };
        let extrinsics = frame.extrinsics.ok_or_else(|| missing("extrinsics"))?;
        let intrinsics = frame.intrinsics.ok_or_else(|| missing("intrinsics"))?;
        Self::new(extrinsics, intrinsics).ok_or_else(|| missing("an invertible camera"))
    }

    /// The camera of world-to-camera extrinsics and intrinsics; none if they cannot be inverted.
    pub(super) fn new(extrinsics: [[f32; 4]; 3], intrinsics: [[f32; 3]; 3]) -> Option<Self> {
        let rotation = rows3(extrinsics.map(|row| [row[0], row[1], row[2]]));
        let translation = DVec3::from_array(extrinsics.map(|row| f64::from(row[3])));
        // A transposed rotation would do for exact poses; predicted ones are orthonormal only to rounding.
        let (back, rays) = (rotation.inverse(), rows3(intrinsics).inverse());
        let sound = back.is_finite() && rays.is_finite() && translation.is_finite();
        sound.then_some(Self { rotation, translation, back, rays })
    }

    /// Camera point of pixel (u, v) at depth d.
    pub(super) fn ray(self, u: f64, v: f64) -> DVec3 {
        self.rays * DVec3::new(u, v, 1.0)
    }

    /// World point of a camera point.
    pub(super) fn to_world(self, point: DVec3) -> DVec3 {
        self.back * (point - self.translation)
    }

    /// Camera point of a world point.
    pub(super) fn to_camera(self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// Camera-to-world rotation and centre.
    pub(super) fn camera_to_world(self) -> (DMat3, DVec3) {
        (self.back, self.to_world(DVec3::ZERO))
    }

    /// Camera-to-world position and orientation (x, y, z, w; w not negative).
    pub(super) fn pose(self) -> (DVec3, DQuat) {
        let q = DQuat::from_mat3(&self.rotation).normalize().conjugate();
        (self.to_world(DVec3::ZERO), if q.w < 0.0 { -q } else { q })
    }
}

/// Calls `each` with every pixel that is a point of the world: finite positive depth, no sky. Row by row.
pub(super) fn for_each_point(
    frame: &FrameResult<'_>,
    camera: &Camera,
    mut each: impl FnMut(&dyn Fn() -> Point) -> Result<(), IoError>,
) -> Result<(), IoError> {
    for i in 0..frame.depth.len() {
        let depth = frame.depth[i];
        if !(depth.is_finite() && depth > 0.0) || frame.sky.is_some_and(|sky| sky[i]) {
            continue;
        }
        let point = || {
            let (u, v) = (i % frame.width as usize, i / frame.width as usize);
            let world = camera.to_world(camera.ray(u as f64, v as f64) * f64::from(depth));
            let confidence = frame.confidence.map_or(1.0, |c| c[i]);
            Point {
                position: world.as_vec3().to_array(),
                colour: [frame.rgb[3 * i], frame.rgb[3 * i + 1], frame.rgb[3 * i + 2]],
                confidence: if confidence.is_finite() { confidence } else { 0.0 },
            }
        };
        each(&point)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unprojection_inverts_projection() {
        let frame = FrameResult {
            index: 0,
            video: 0,
            frame: 0,
            time_s: None,
            width: 1,
            height: 1,
            depth: &[2.0],
            confidence: None,
            rgb: &[1, 2, 3],
            // A quarter turn about z, and a step.
            extrinsics: Some([[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]]),
            intrinsics: Some([[100.0, 0.0, 10.0], [0.0, 50.0, 20.0], [0.0, 0.0, 1.0]]),
            sky: None,
            gaussians: None,
            features: &[],
            source: None,
        };
        let camera = Camera::of(&frame, "ply").unwrap();
        let world = camera.to_world(camera.ray(60.0, 45.0) * 2.0);
        let seen = camera.to_camera(world);
        assert!((seen - DVec3::new(1.0, 1.0, 2.0)).length() < 1e-12, "{seen}");
        let (centre, q) = camera.pose();
        assert!((centre - DVec3::new(-2.0, 1.0, -3.0)).length() < 1e-12, "{centre}");
        assert!((q * DVec3::X - DVec3::new(0.0, -1.0, 0.0)).length() < 1e-12, "{q}");
    }
}
