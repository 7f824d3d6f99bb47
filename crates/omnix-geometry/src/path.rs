//! Cameras between cameras, around a point and towards one: what a film flies along.

use glam::{DMat3, DVec3, DVec4};

use crate::camera::Camera;
use crate::pose::{Pose, Rigid, matrix_from_quaternion, quaternion_from_matrix, to_rows};

/// How a curve meets the cameras that it is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Curve {
    /// It goes through each of them (Catmull and Rom's spline).
    Through,
    /// It passes near them, without their shake (a uniform cubic B-spline).
    Near,
}

impl Curve {
    /// Shares of four neighbouring cameras, `s` from 0 at the second to 1 at the third; their sum is 1.
    fn shares(self, s: f64) -> [f64; 4] {
        let (s2, s3) = (s * s, s * s * s);
        match self {
            Self::Through => [
                (-s + 2.0 * s2 - s3) / 2.0,
                (2.0 - 5.0 * s2 + 3.0 * s3) / 2.0,
                (s + 4.0 * s2 - 3.0 * s3) / 2.0,
                (s3 - s2) / 2.0,
            ],
            Self::Near => [
                (1.0 - 3.0 * s + 3.0 * s2 - s3) / 6.0,
                (4.0 - 6.0 * s2 + 3.0 * s3) / 6.0,
                (1.0 + 3.0 * s + 3.0 * s2 - 3.0 * s3) / 6.0,
                s3 / 6.0,
            ],
        }
    }
}

/// The camera at `at` of a curve over `cameras`, 0 at the first, n - 1 at the last; before and behind, those. Centres and
/// intrinsics are mixed as they are, orientations as quaternions of one half of their sphere, normalised. None of no cameras.
#[must_use]
pub fn camera_on_curve(cameras: &[Camera], at: f64, curve: Curve) -> Option<Camera> {
    let last = cameras.len().checked_sub(1)?;
    let at = at.clamp(0.0, last as f64);
    let (low, s) = (at.floor() as usize, at.fract());
    if s == 0.0 && curve == Curve::Through {
        return cameras.get(low).copied();
    }
    let shares = curve.shares(s);
    let (mut centre, mut turn, mut first) = (DVec3::ZERO, DVec4::ZERO, None);
    let mut intrinsics = [[0f64; 3]; 3];
    for (k, share) in shares.into_iter().enumerate() {
        let camera = &cameras[(low + k).saturating_sub(1).min(last)];
        let c2w = Rigid::from_rows(&camera.extrinsics).inverse();
        let quaternion = DVec4::from_array(quaternion_from_matrix(c2w.rotation));
        let first = *first.get_or_insert(quaternion);
        turn += share * if first.dot(quaternion) < 0.0 { -quaternion } else { quaternion };
        centre += share * c2w.translation;
        for (sum, value) in intrinsics.as_flattened_mut().iter_mut().zip(camera.intrinsics.as_flattened()) {
            *sum += share * f64::from(*value);
        }
    }
    let c2w = Rigid { rotation: matrix_from_quaternion(turn.to_array()), translation: centre };
    let intrinsics = intrinsics.map(|row| row.map(|v| v as f32));
    Some(Camera { extrinsics: to_rows(c2w.inverse()), intrinsics })
}

/// The camera carried around `pivot`: first up by `pitch`, then to its right by `yaw` (radians), `away` times as far from it.
#[must_use]
pub fn orbit_camera(camera: &Camera, pivot: [f32; 3], [yaw, pitch]: [f64; 2], away: f64) -> Camera {
    let c2w = Rigid::from_rows(&camera.extrinsics).inverse();
    let pivot = DVec3::from_array(pivot.map(f64::from));
    let [right, down] = [c2w.rotation.x_axis.normalize(), c2w.rotation.y_axis.normalize()];
    let turn = DMat3::from_axis_angle(down, -yaw) * DMat3::from_axis_angle(right, -pitch);
    let moved = Rigid { rotation: turn * c2w.rotation, translation: pivot + turn * (c2w.translation - pivot) * away };
    Camera { extrinsics: to_rows(moved.inverse()), ..*camera }
}

/// World-to-camera pose of a camera at `position` that looks at `target`, `up` being up in its picture; none where these do not say
/// a direction.
#[must_use]
pub fn look_at(position: [f64; 3], target: [f64; 3], up: [f64; 3]) -> Option<Pose> {
    let [position, target, up] = [position, target, up].map(DVec3::from_array);
    let forward = (target - position).try_normalize()?;
    let right = forward.cross(up.try_normalize()?).try_normalize()?;
    let c2w = Rigid { rotation: DMat3::from_cols(right, forward.cross(right), forward), translation: position };
    c2w.rotation.is_finite().then(|| to_rows(c2w.inverse()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{IDENTITY_POSE, camera_centre};

    fn camera(x: f64, yaw: f64) -> Camera {
        let rotation = DMat3::from_rotation_y(yaw);
        let c2w = Rigid { rotation, translation: DVec3::new(x, 0.0, 0.0) };
        Camera {
            extrinsics: to_rows(c2w.inverse()),
            intrinsics: [[100.0 + x as f32, 0.0, 10.0], [0.0, 100.0, 5.0], [0.0, 0.0, 1.0]],
        }
    }

    #[test]
    fn a_curve_of_even_steps_is_even() {
        let cameras: Vec<Camera> = (0..6).map(|k| camera(f64::from(k), 0.1 * f64::from(k))).collect();
        for curve in [Curve::Through, Curve::Near] {
            for at in [1.0, 2.25, 3.5] {
                let seen = camera_on_curve(&cameras, at, curve).unwrap();
                let want = camera(at, 0.1 * at);
                for (a, b) in seen.extrinsics.iter().flatten().zip(want.extrinsics.iter().flatten()) {
                    assert!((a - b).abs() < 2e-3, "{curve:?} {at}: {seen:?} {want:?}");
                }
                assert!((seen.intrinsics[0][0] - want.intrinsics[0][0]).abs() < 1e-3);
            }
        }
        assert_eq!(camera_on_curve(&cameras, -3.0, Curve::Through), Some(cameras[0]));
        assert_eq!(camera_on_curve(&cameras, 9.0, Curve::Through), Some(cameras[5]));
        assert_eq!(camera_on_curve(&[], 0.0, Curve::Near), None);
        assert!(camera_on_curve(&cameras[..1], 0.0, Curve::Near).is_some());
    }

    #[test]
    fn shake_is_taken_out_by_the_near_curve_alone() {
        let cameras: Vec<Camera> =
            (0..8).map(|k| camera(f64::from(k) + if k % 2 == 0 { 0.5 } else { -0.5 }, 0.0)).collect();
        let x = |curve| camera_centre(&camera_on_curve(&cameras, 4.0, curve).unwrap().extrinsics)[0];
        assert!((x(Curve::Through) - 4.5).abs() < 1e-6 && (x(Curve::Near) - 4.0).abs() < 0.2);
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_its_pivot_in_the_middle() {
        let start = Camera { extrinsics: IDENTITY_POSE, intrinsics: camera(0.0, 0.0).intrinsics };
        for (yaw, pitch) in [(0.7, 0.0), (0.0, 0.4), (-0.3, 0.2), (3.0, 0.5)] {
            let moved = orbit_camera(&start, [0.0, 0.0, 4.0], [yaw, pitch], 1.5);
            let row = |r: usize| moved.extrinsics[r][2] * 4.0 + moved.extrinsics[r][3];
            assert!(row(0).abs() < 1e-5 && row(1).abs() < 1e-5 && (row(2) - 6.0).abs() < 1e-5, "{yaw} {pitch}");
        }
        // To the right is positive x, up is negative y.
        let right = camera_centre(&orbit_camera(&start, [0.0, 0.0, 4.0], [0.5, 0.0], 1.0).extrinsics);
        let up = camera_centre(&orbit_camera(&start, [0.0, 0.0, 4.0], [0.0, 0.5], 1.0).extrinsics);
        assert!(right[0] > 1.0 && up[1] < -1.0, "{right:?} {up:?}");
    }

    #[test]
    fn looking_at_something_puts_it_ahead() {
        let pose = look_at([1.0, -2.0, 3.0], [1.0, -2.0, 9.0], [0.0, -1.0, 0.0]).unwrap();
        assert_eq!(pose.map(|row| [row[0], row[1], row[2]]), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(look_at([0.0; 3], [0.0; 3], [0.0, -1.0, 0.0]), None);
        assert_eq!(look_at([0.0; 3], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]), None);
    }
}
