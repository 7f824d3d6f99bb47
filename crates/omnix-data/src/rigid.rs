//! Rigid motions and pinhole cameras in f64, for sums and for files whose worlds are large.

use glam::{DMat3, DVec3};
use omnix_geometry::{Camera, Matrix3, Pose};

/// `x -> rotation x + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rigid {
    pub(crate) rotation: DMat3,
    pub(crate) translation: DVec3,
}

impl Rigid {
    /// From three rows `[R|t]`.
    pub(crate) fn from_rows(rows: [[f64; 4]; 3]) -> Self {
        let rotation = DMat3::from_cols_array_2d(&rows.map(|[a, b, c, _]| [a, b, c])).transpose();
        Self { rotation, translation: DVec3::from(rows.map(|row| row[3])) }
    }

    pub(crate) fn from_pose(pose: &Pose) -> Self {
        Self::from_rows(pose.map(|row| row.map(f64::from)))
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

    pub(crate) fn apply(self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// Rounded to f32.
    pub(crate) fn to_pose(self) -> Pose {
        let rows = self.rotation.transpose().to_cols_array_2d();
        let t = self.translation.to_array();
        std::array::from_fn(|i| [rows[i][0], rows[i][1], rows[i][2], t[i]].map(|v| v as f32))
    }
}

/// A pinhole camera in f64.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pinhole {
    /// World to camera.
    pub(crate) w2c: Rigid,
    /// fx, fy, cx, cy in pixels.
    pub(crate) focal: [f64; 2],
    pub(crate) principal: [f64; 2],
    pub(crate) skew: f64,
}

impl Pinhole {
    pub(crate) fn new(camera: &Camera) -> Self {
        let k = camera.intrinsics.map(|row| row.map(f64::from));
        Self {
            w2c: Rigid::from_pose(&camera.extrinsics),
            focal: [k[0][0], k[1][1]],
            principal: [k[0][2], k[1][2]],
            skew: k[0][1],
        }
    }

    pub(crate) fn to_camera(self) -> Camera {
        let [[fx, fy], [cx, cy]] = [self.focal, self.principal];
        let intrinsics: Matrix3 =
            [[fx, self.skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]].map(|row| row.map(|v| v as f32));
        Camera { extrinsics: self.w2c.to_pose(), intrinsics }
    }

    /// The camera of the picture resized by these factors across and down.
    pub(crate) fn resize(&mut self, [across, down]: [f64; 2]) {
        self.focal = [self.focal[0] * across, self.focal[1] * down];
        self.principal = [self.principal[0] * across, self.principal[1] * down];
        self.skew *= across;
    }

    /// The point in the camera's frame that is seen at image coordinates (u, v) at this depth.
    pub(crate) fn unproject(&self, u: f64, v: f64, depth: f64) -> DVec3 {
        let y = (v - self.principal[1]) / self.focal[1];
        let x = (u - self.principal[0] - self.skew * y) / self.focal[0];
        DVec3::new(x * depth, y * depth, depth)
    }

    /// Image coordinates (u, v) of a point in the camera's frame; meaningless where z <= 0.
    pub(crate) fn project(&self, point: DVec3) -> [f64; 2] {
        let (x, y) = (point.x / point.z, point.y / point.z);
        [self.focal[0] * x + self.skew * y + self.principal[0], self.focal[1] * y + self.principal[1]]
    }
}

/// Image coordinates of the centre of the pixel of this index in a row-major image of this width.
pub(crate) fn centre(pixel: usize, width: usize) -> [f64; 2] {
    let offset = crate::PIXEL.offset();
    [(pixel % width) as f64 + offset, (pixel / width) as f64 + offset]
}
