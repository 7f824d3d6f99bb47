//! Cameras as the network states them: the pose code of nine numbers (`spec/da3.md` 8.1, 8.2).

use glam::DVec3;

use crate::GeometryError;
use crate::pose::{Matrix3, Pose, Rigid, matrix_from_quaternion, quaternion_from_matrix, to_rows};

/// The least tangent of half a field of view that the decoder admits.
const MIN_TANGENT: f64 = 1e-6;
/// The least distance by which given cameras are divided.
const MIN_DISTANCE: f64 = 0.1;

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// World to camera, `[R|t]`.
    pub extrinsics: Pose,
    /// fx, skew, cx / 0, fy, cy / 0, 0, 1 in pixels.
    pub intrinsics: Matrix3,
}

/// The camera of a pose code: c2w translation (3), quaternion x, y, z, w of any length (4), vertical and horizontal field
/// of view in radians (2), for a picture of `height` x `width` pixels (`spec/da3.md` 8.1).
///
/// `fx = (W/2)/max(tan(fov_w/2), 1e-6)`, fy alike, principal point (W/2, H/2); extrinsics `[R^T | -R^T t]`.
#[must_use]
pub fn decode_pose_code(code: [f32; 9], height: u32, width: u32) -> Camera {
    let [tx, ty, tz, qx, qy, qz, qw, fov_h, fov_w] = code.map(f64::from);
    let c2w = Rigid { rotation: matrix_from_quaternion([qx, qy, qz, qw]), translation: DVec3::new(tx, ty, tz) };
    let focal = |size: u32, fov: f64| (f64::from(size) / 2.0 / (fov / 2.0).tan().max(MIN_TANGENT)) as f32;
    let centre = |size: u32| (f64::from(size) / 2.0) as f32;
    Camera {
        extrinsics: to_rows(c2w.inverse()),
        intrinsics: [
            [focal(width, fov_w), 0.0, centre(width)],
            [0.0, focal(height, fov_h), centre(height)],
            [0.0, 0.0, 1.0],
        ],
    }
}

/// The pose code of a camera for a picture of `height` x `width` pixels (`spec/da3.md` 8.2), the inverse of
/// [`decode_pose_code`] with a unit quaternion, w >= 0; `fov_h = 2 atan((H/2)/fy)`, `fov_w = 2 atan((W/2)/fx)`. Skew and
/// principal point are lost.
#[must_use]
pub fn encode_pose_code(camera: &Camera, height: u32, width: u32) -> [f32; 9] {
    let c2w = Rigid::from_rows(&camera.extrinsics).inverse();
    let t = c2w.translation;
    let [qx, qy, qz, qw] = quaternion_from_matrix(c2w.rotation);
    let fov = |size: u32, focal: f32| 2.0 * (f64::from(size) / 2.0 / f64::from(focal)).atan();
    let (fov_h, fov_w) = (fov(height, camera.intrinsics[1][1]), fov(width, camera.intrinsics[0][0]));
    [t.x, t.y, t.z, qx, qy, qz, qw, fov_h, fov_w].map(|v| v as f32)
}

/// Normalises given w2c extrinsics before they are encoded (`spec/da3.md` 8.2).
///
/// `E_i <- E_i inverse(E_0)`, so that the first view becomes the identity; then translations are divided by `max(m, 0.1)`,
/// m the lower median over all views of the camera centre's distance from the first.
///
/// # Errors
/// A pose that is not finite.
pub fn normalise_extrinsics(w2c: &[Pose]) -> Result<Vec<Pose>, GeometryError> {
    let Some(first) = w2c.first() else {
        return Ok(Vec::new());
    };
    if let Some(view) = w2c.iter().position(|pose| pose.iter().flatten().any(|v| !v.is_finite())) {
        return Err(GeometryError::InvalidCamera { view, reason: "its pose has a NaN or infinity" });
    }
    let to_first = Rigid::from_rows(first).inverse();
    let mut poses: Vec<Rigid> = w2c.iter().map(|pose| Rigid::from_rows(pose).after(to_first)).collect();
    // The first centre is the origin now.
    let mut distances: Vec<f64> = poses.iter().map(|pose| pose.inverse().translation.length()).collect();
    distances.sort_by(f64::total_cmp);
    let scale = distances[(distances.len() - 1) / 2].max(MIN_DISTANCE);
    for pose in &mut poses {
        pose.translation /= scale;
    }
    Ok(poses.into_iter().map(to_rows).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_survives_decoding_and_encoding() {
        let code = [0.3, -0.2, 1.5, 0.1, 0.7, -0.1, 0.7, 0.8, 1.1];
        let back = encode_pose_code(&decode_pose_code(code, 280, 504), 280, 504);
        for (a, b) in code.iter().zip(back) {
            assert!((a - b).abs() < 1e-6, "{code:?} {back:?}");
        }
    }

    #[test]
    fn no_field_of_view_gives_a_finite_focal_length() {
        let camera = decode_pose_code([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 10, 20);
        assert_eq!(camera.intrinsics[0][0], 1e7);
    }

    #[test]
    fn normalising_refuses_nan_and_takes_no_views() {
        let mut pose = crate::IDENTITY_POSE;
        assert_eq!(normalise_extrinsics(&[]), Ok(Vec::new()));
        assert_eq!(normalise_extrinsics(&[pose]), Ok(vec![pose]));
        pose[1][3] = f32::NAN;
        let error = normalise_extrinsics(&[crate::IDENTITY_POSE, pose]);
        assert!(matches!(error, Err(GeometryError::InvalidCamera { view: 1, .. })));
    }
}
