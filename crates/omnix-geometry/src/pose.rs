//! Poses as 3x4 matrices `[R|t]`, rotations as quaternions (`spec/da3.md` 8.1 to 8.3).

use glam::{DMat3, DVec3};

/// `[R|t]` as three rows of four numbers; whether it is `w2c` or `c2w` is said by the name of the variable.
pub type Pose = [[f32; 4]; 3];

/// A 3x3 matrix as three rows.
pub type Matrix3 = [[f32; 3]; 3];

/// The identity pose.
pub const IDENTITY_POSE: Pose = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The inverse of a rigid pose, `[R^T | -R^T t]`: from w2c to c2w and back.
#[must_use]
pub fn invert_pose(pose: &Pose) -> Pose {
    to_rows(Rigid::from_rows(pose).inverse())
}

/// The pose that applies `first`, then `then`: `R = R_then R_first`, `t = R_then t_first + t_then`.
#[must_use]
pub fn compose_poses(then: &Pose, first: &Pose) -> Pose {
    to_rows(Rigid::from_rows(then).after(Rigid::from_rows(first)))
}

/// The camera centre in world coordinates of a w2c pose, `-R^T t`.
#[must_use]
pub fn camera_centre(w2c: &Pose) -> [f32; 3] {
    Rigid::from_rows(w2c).inverse().translation.as_vec3().to_array()
}

/// Three rows with the row (0, 0, 0, 1) below them.
#[must_use]
pub fn pose_to_4x4(pose: &Pose) -> [[f32; 4]; 4] {
    [pose[0], pose[1], pose[2], [0.0, 0.0, 0.0, 1.0]]
}

/// The rotation of a quaternion (x, y, z, w) of any length (`spec/da3.md` 8.1): `I + ...` with the factor `2/|q|^2`.
///
/// A zero quaternion gives NaN, as in the reference.
#[must_use]
pub fn rotation_from_quaternion(xyzw: [f32; 4]) -> Matrix3 {
    rows3(matrix_from_quaternion(xyzw.map(f64::from)))
}

/// The quaternion (x, y, z, w), w >= 0, of a rotation (`spec/da3.md` 8.3). Of unit length for an exact rotation.
#[must_use]
pub fn quaternion_from_rotation(rotation: &Matrix3) -> [f32; 4] {
    quaternion_from_matrix(matrix3(rotation)).map(|v| v as f32)
}

/// A c2w pose as a TUM trajectory line wants it: translation, then the unit quaternion x, y, z, w.
#[must_use]
pub fn tum_from_c2w(c2w: &Pose) -> ([f32; 3], [f32; 4]) {
    let Rigid { rotation, translation } = Rigid::from_rows(c2w);
    let q = quaternion_from_matrix(rotation);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    (translation.as_vec3().to_array(), q.map(|v| (v / length) as f32))
}

/// A rigid motion in f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rigid {
    pub(crate) rotation: DMat3,
    pub(crate) translation: DVec3,
}

impl Rigid {
    pub(crate) fn from_rows(pose: &Pose) -> Self {
        let rotation = matrix3(&pose.map(|[a, b, c, _]| [a, b, c]));
        let [x, y, z] = pose.map(|row| f64::from(row[3]));
        Self { rotation, translation: DVec3::new(x, y, z) }
    }

    pub(crate) fn inverse(self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// This motion after `first`.
    pub(crate) fn after(self, first: Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation + self.translation,
        }
    }
}

pub(crate) fn to_rows(pose: Rigid) -> Pose {
    let rows = rows3(pose.rotation);
    let t = pose.translation.as_vec3().to_array();
    std::array::from_fn(|i| [rows[i][0], rows[i][1], rows[i][2], t[i]])
}

pub(crate) fn matrix3(rows: &Matrix3) -> DMat3 {
    // glam stores columns.
    DMat3::from_cols_array_2d(&rows.map(|row| row.map(f64::from))).transpose()
}

pub(crate) fn rows3(matrix: DMat3) -> Matrix3 {
    matrix.transpose().to_cols_array_2d().map(|row| row.map(|v| v as f32))
}

pub(crate) fn matrix_from_quaternion([x, y, z, w]: [f64; 4]) -> DMat3 {
    let s = 2.0 / (x * x + y * y + z * z + w * w);
    let rows = [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
    ];
    DMat3::from_cols_array_2d(&rows).transpose()
}

pub(crate) fn quaternion_from_matrix(matrix: DMat3) -> [f64; 4] {
    let m = matrix.transpose().to_cols_array_2d();
    let candidates = [
        1.0 + m[0][0] + m[1][1] + m[2][2],
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
    ]
    .map(|v: f64| v.max(0.0).sqrt());
    // The first of the largest.
    let best = (1..4).fold(0, |best, k| if candidates[k] > candidates[best] { k } else { best });
    let square = candidates[best] * candidates[best];
    // Rows of the product matrix 4 q q^T in the order w, x, y, z.
    let wxyz = match best {
        0 => [square, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        1 => [m[2][1] - m[1][2], square, m[1][0] + m[0][1], m[0][2] + m[2][0]],
        2 => [m[0][2] - m[2][0], m[1][0] + m[0][1], square, m[1][2] + m[2][1]],
        _ => [m[1][0] - m[0][1], m[2][0] + m[0][2], m[2][1] + m[1][2], square],
    };
    let scale = 1.0 / (2.0 * candidates[best].max(0.1));
    let [w, x, y, z] = wxyz.map(|v| v * scale);
    if w < 0.0 { [-x, -y, -z, -w] } else { [x, y, z, w] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER_TURN_Z: Pose = [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];

    #[test]
    fn a_pose_after_its_inverse_is_the_identity() {
        let composed = compose_poses(&QUARTER_TURN_Z, &invert_pose(&QUARTER_TURN_Z));
        assert_eq!(composed, IDENTITY_POSE);
        assert_eq!(camera_centre(&QUARTER_TURN_Z), [-2.0, 1.0, -3.0]);
    }

    #[test]
    fn every_branch_of_the_quaternion_is_reached() {
        for q in [[0.1, 0.2, -0.1, 0.9], [0.9, 0.1, 0.2, 0.1], [0.1, 0.9, 0.2, 0.1], [-0.1, 0.2, 0.9, 0.1f64]] {
            let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            let back = quaternion_from_matrix(matrix_from_quaternion(q));
            for k in 0..4 {
                assert!((back[k] - q[k] / length).abs() < 1e-12, "{q:?} {back:?}");
            }
        }
    }

    #[test]
    fn tum_lines_have_unit_quaternions() {
        let (t, q) = tum_from_c2w(&QUARTER_TURN_Z);
        assert_eq!(t, [1.0, 2.0, 3.0]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert!(q.iter().zip([0.0, 0.0, half, half]).all(|(a, b)| (a - b).abs() < 1e-6), "{q:?}");
    }
}
