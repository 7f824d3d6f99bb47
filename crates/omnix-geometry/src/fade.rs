//! From one reconstruction to the next where both have an image: cameras in between.

use glam::{DMat3, DQuat};

use crate::camera::Camera;
use crate::pose::{Rigid, to_rows};

/// The camera that lies `part` (0 to 1) of the way from `earlier` to `later`, both in one world: its centre and its intrinsics on the
/// line between theirs, its rotation on the shortest arc. At 0 and 1 it is the one and the other, bit for bit.
#[must_use]
pub fn fade_cameras(earlier: &Camera, later: &Camera, part: f64) -> Camera {
    if part <= 0.0 {
        return *earlier;
    }
    if part >= 1.0 {
        return *later;
    }
    let [a, b] = [earlier, later].map(|camera| Rigid::from_rows(&camera.extrinsics).inverse());
    let [from, to] = [a, b].map(|pose| DQuat::from_mat3(&pose.rotation).normalize());
    let rotation = DMat3::from_quat(from.slerp(to, part));
    let c2w = Rigid { rotation, translation: a.translation.lerp(b.translation, part) };
    let between = |i: usize, j: usize| {
        let [from, to] = [earlier, later].map(|camera| f64::from(camera.intrinsics[i][j]));
        (from + (to - from) * part) as f32
    };
    let intrinsics = std::array::from_fn(|i| std::array::from_fn(|j| between(i, j)));
    Camera { extrinsics: to_rows(c2w.inverse()), intrinsics }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::{IDENTITY_POSE, camera_centre};

    #[test]
    fn halfway_is_halfway() {
        let intrinsics = [[10.0, 0.0, 5.0], [0.0, 10.0, 5.0], [0.0, 0.0, 1.0]];
        let earlier = Camera { extrinsics: IDENTITY_POSE, intrinsics };
        // A quarter turn about z, centre (2, 0, 4).
        let turned = [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, -4.0]];
        let later = Camera { extrinsics: turned, intrinsics: [[20.0, 0.0, 5.0], [0.0, 10.0, 5.0], [0.0, 0.0, 1.0]] };
        let half = fade_cameras(&earlier, &later, 0.5);
        let centre = camera_centre(&half.extrinsics);
        assert!(centre.iter().zip([1.0, 0.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{centre:?}");
        let cos = std::f32::consts::FRAC_1_SQRT_2;
        assert!((half.extrinsics[0][0] - cos).abs() < 1e-6 && (half.extrinsics[0][1] - cos).abs() < 1e-6, "{half:?}");
        assert_eq!(half.intrinsics[0][0], 15.0);
        assert_eq!((fade_cameras(&earlier, &later, 0.0), fade_cameras(&earlier, &later, 1.0)), (earlier, later));
    }
}
