//! A pinhole camera at one time, and the rays of its pixels.
//!
//! OpenCV axes: x right, y down, z forward. Pixel (column j, row i) is looked through at (j + 0.5, i + 0.5), so a principal point in
//! the middle of the picture is (width / 2, height / 2).

use glam::{DMat3, DVec2, DVec3};

use crate::cast::Ray;

/// What is added to a pixel's indices for the point that its labels belong to.
pub const PIXEL_CENTRE: f64 = 0.5;

/// A camera's place and lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Camera to world: the columns are the camera's axes.
    pub rotation: DMat3,
    /// The camera's centre in the world.
    pub centre: DVec3,
    /// Focal lengths in pixels.
    pub focal: DVec2,
    /// Principal point in pixels.
    pub principal: DVec2,
    /// Width and height in pixels.
    pub size: [usize; 2],
}

impl View {
    /// A camera that looks from one point to another, turned about its axis by `roll`.
    pub(crate) fn looking(from: DVec3, to: DVec3, roll: f64, focal: f64, principal: DVec2, size: [usize; 2]) -> Self {
        let forward = (to - from).normalize_or(DVec3::Y);
        let right = forward.cross(DVec3::Z).normalize_or(DVec3::X);
        let down = forward.cross(right);
        let (sin, cos) = roll.sin_cos();
        let rotation = DMat3::from_cols(right * cos + down * sin, down * cos - right * sin, forward);
        Self { rotation, centre: from, focal: DVec2::splat(focal), principal, size }.stored()
    }

    /// The camera whose numbers survive being stored as f32, world to camera: labels are exact for what is written.
    fn stored(self) -> Self {
        let round = |v: f64| f64::from(v as f32);
        let inverse = DMat3::from_cols_array(&self.rotation.transpose().to_cols_array().map(round));
        let translation = DVec3::from_array((-(inverse * self.centre)).to_array().map(round));
        // Not its transpose: the rounded matrix is not quite a rotation.
        let rotation = inverse.inverse();
        Self {
            rotation,
            centre: -(rotation * translation),
            focal: DVec2::new(round(self.focal.x), round(self.focal.y)),
            principal: DVec2::new(round(self.principal.x), round(self.principal.y)),
            size: self.size,
        }
    }

    /// World to camera as three rows of `[R|t]`.
    #[must_use]
    pub fn extrinsics(&self) -> [[f32; 4]; 3] {
        let inverse = self.rotation.inverse();
        let t = -(inverse * self.centre);
        std::array::from_fn(|i| {
            let row = inverse.row(i);
            [row.x as f32, row.y as f32, row.z as f32, t[i] as f32]
        })
    }

    /// fx, 0, cx / 0, fy, cy / 0, 0, 1.
    #[must_use]
    pub fn intrinsics(&self) -> [[f32; 3]; 3] {
        [
            [self.focal.x as f32, 0.0, self.principal.x as f32],
            [0.0, self.focal.y as f32, self.principal.y as f32],
            [0.0, 0.0, 1.0],
        ]
    }

    /// The ray through a point of the picture; its parameter is z-depth.
    pub(crate) fn ray(&self, at: DVec2) -> Ray {
        let q = (at - self.principal) / self.focal;
        Ray { origin: self.centre, direction: self.rotation * q.extend(1.0) }
    }

    /// The point that a pixel's labels belong to.
    pub(crate) fn pixel(column: usize, row: usize) -> DVec2 {
        DVec2::new(column as f64 + PIXEL_CENTRE, row as f64 + PIXEL_CENTRE)
    }

    /// Where a world point lies in the picture, and its depth; nothing for a point that is not in front of the camera.
    pub(crate) fn project(&self, point: DVec3) -> Option<(DVec2, f64)> {
        let p = self.rotation.inverse() * (point - self.centre);
        (p.z > 1e-9).then(|| (p.truncate() / p.z * self.focal + self.principal, p.z))
    }

    /// The pixel that a point of the picture lies in.
    pub(crate) fn pixel_of(&self, at: DVec2) -> Option<[usize; 2]> {
        let [width, height] = self.size;
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < width as f64 && at.y < height as f64;
        inside.then_some([at.x as usize, at.y as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_go_where_points_are_projected() {
        let from = DVec3::new(3.0, -2.0, 1.6);
        let view = View::looking(from, DVec3::new(0.3, 0.5, 0.7), 0.2, 130.0, DVec2::new(71.0, 40.0), [140, 84]);
        assert!((view.rotation.determinant() - 1.0).abs() < 1e-6);
        for (column, row) in [(0, 0), (139, 83), (70, 13)] {
            let at = View::pixel(column, row);
            let (back, depth) = view.project(view.ray(at).at(2.5)).unwrap();
            assert!(back.distance(at) < 1e-9 && (depth - 2.5).abs() < 1e-12);
            assert_eq!(view.pixel_of(back), Some([column, row]));
        }
        // Up in the world is up in the picture, and x is to the right.
        let up = view.project(DVec3::new(0.3, 0.5, 1.0)).unwrap().0;
        assert!(up.y < view.principal.y);
        assert_eq!(view.project(from * 2.0), None);
    }
}
