//! Rigid motions in f64, from the plain arrays of files: camera-to-world or world-to-camera, said by the name of the variable.
//!
//! `omnix-geometry` holds poses as f32, since networks do; published pose errors are compared to 1e-8, so they are f64 here.

use glam::{DMat3, DQuat, DVec3};

/// `y = R x + t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid {
    rotation: DMat3,
    translation: DVec3,
}

impl Rigid {
    /// Nothing moves.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// From a position and a quaternion (x, y, z, w) of any length but zero; none if a number is NaN, infinite or the quaternion zero.
    #[must_use]
    pub fn from_quaternion(translation: [f64; 3], xyzw: [f64; 4]) -> Option<Self> {
        let q = DQuat::from_array(xyzw);
        let whole = translation.iter().chain(&xyzw).all(|v| v.is_finite()) && q.length() > f64::EPSILON;
        whole.then(|| Self { rotation: DMat3::from_quat(q.normalize()), translation: translation.into() })
    }

    /// From three rows `[R|t]`; none if a number is NaN or infinite.
    #[must_use]
    pub fn from_rows(rows: &[[f64; 4]; 3]) -> Option<Self> {
        let columns = DMat3::from_cols_array_2d(&rows.map(|[a, b, c, _]| [a, b, c])).transpose();
        let found = Self { rotation: columns, translation: DVec3::from(rows.map(|row| row[3])) };
        (found.rotation.is_finite() && found.translation.is_finite()).then_some(found)
    }

    /// Three rows `[R|t]`.
    #[must_use]
    pub fn rows(&self) -> [[f64; 4]; 3] {
        let r = self.rotation_rows();
        let t = self.translation();
        std::array::from_fn(|i| [r[i][0], r[i][1], r[i][2], t[i]])
    }

    /// The rotation as three rows.
    #[must_use]
    pub fn rotation_rows(&self) -> [[f64; 3]; 3] {
        self.rotation.transpose().to_cols_array_2d()
    }

    /// The translation; the camera's position if this is camera-to-world.
    #[must_use]
    pub fn translation(&self) -> [f64; 3] {
        self.translation.to_array()
    }

    /// The same rotation elsewhere.
    #[must_use]
    pub fn with_translation(mut self, translation: [f64; 3]) -> Self {
        self.translation = translation.into();
        self
    }

    /// The inverse, `x = R^T (y - t)`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// This motion after `first`.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation + self.translation,
        }
    }

    /// Moves a point.
    #[must_use]
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        (self.rotation * DVec3::from(point) + self.translation).to_array()
    }

    /// The angle of the rotation in degrees, 0 to 180; exact to rounding also near 0 and 180.
    #[must_use]
    pub fn angle_degrees(&self) -> f64 {
        let m = self.rotation_rows();
        let axis = DVec3::new(m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
        // |axis| = 2 sin, trace - 1 = 2 cos.
        axis.length().atan2(m[0][0] + m[1][1] + m[2][2] - 1.0).to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_after_its_inverse_is_nothing() {
        let motion = Rigid::from_quaternion([1.0, -2.0, 3.0], [0.2, -0.4, 0.1, 1.6]).unwrap();
        let back = motion.inverse().after(&motion);
        assert!(back.angle_degrees() < 1e-7 && back.translation().iter().all(|v| v.abs() < 1e-12));
        let [x, y, z] = motion.inverse().apply(motion.apply([0.5, 0.25, -1.0]));
        assert!((x - 0.5).abs() + (y - 0.25).abs() + (z + 1.0).abs() < 1e-12);
    }

    #[test]
    fn angles_of_small_and_half_turns() {
        for degrees in [0.0, 1e-6, 30.0, 90.0, 179.999_999, 180.0f64] {
            let (sin, cos) = (degrees.to_radians() / 2.0).sin_cos();
            let turn = Rigid::from_quaternion([0.0; 3], [0.0, sin, 0.0, cos]).unwrap();
            assert!((turn.angle_degrees() - degrees).abs() < 1e-7, "{degrees}");
        }
    }

    #[test]
    fn what_is_no_motion_is_refused() {
        assert!(Rigid::from_quaternion([0.0; 3], [0.0; 4]).is_none());
        assert!(Rigid::from_quaternion([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]).is_none());
        let rows = [[1.0, 0.0, 0.0, f64::INFINITY], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        assert!(Rigid::from_rows(&rows).is_none());
    }
}
