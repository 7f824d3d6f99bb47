//! Between depth maps and world points (`spec/da3.md` 13, `spec/omnix.md` 4.4).
//!
//! Depth is z-depth in the camera's frame. Maps are row-major `[height, width]`, points `[height, width, 3]`.

use glam::{DMat3, DVec3};

use crate::GeometryError;
use crate::camera::Camera;
use crate::pose::{Matrix3, Pose, Rigid, matrix3};

/// Where in image coordinates the pixel (column j, row i) lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PixelCentre {
    /// At (j, i), as the reference networks and Depth Anything 3's exports have it.
    Whole,
    /// At (j + 0.5, i + 0.5), as our own unprojection has it.
    Half,
}

impl PixelCentre {
    /// What is added to the pixel's index.
    #[must_use]
    pub const fn offset(self) -> f64 {
        match self {
            Self::Whole => 0.0,
            Self::Half => 0.5,
        }
    }
}

/// World points of a depth map: `X = R (depth K^-1 (u, v, 1)) + t` with the c2w pose `[R|t]`; `[height, width, 3]`.
///
/// A depth that is not finite gives points that are not finite.
///
/// # Errors
/// `depth` of another length than `height * width`, or intrinsics without inverse.
pub fn points_from_depth(
    depth: &[f32],
    [height, width]: [usize; 2],
    intrinsics: &Matrix3,
    c2w: &Pose,
    pixel: PixelCentre,
) -> Result<Vec<[f32; 3]>, GeometryError> {
    expect_length("depth map", height * width, depth.len())?;
    let inverse = invert_intrinsics(intrinsics)?;
    let Rigid { rotation, translation } = Rigid::from_rows(c2w);
    let to_world = rotation * inverse;
    let pixels = (0..height).flat_map(|i| (0..width).map(move |j| (j, i)));
    let points = pixels.zip(depth).map(|((j, i), &z)| {
        let uv = DVec3::new(j as f64 + pixel.offset(), i as f64 + pixel.offset(), 1.0);
        (to_world * uv * f64::from(z) + translation).as_vec3().to_array()
    });
    Ok(points.collect())
}

/// World points of a depth map along given rays: `X = origin + depth * direction`; the direction is not unit, six numbers
/// a pixel, direction first (`spec/omnix.md` 4.4). `rays` is `[height, width, 6]` at the size of `depth`.
///
/// # Errors
/// Lists whose lengths do not belong together.
pub fn points_from_rays(rays: &[f32], depth: &[f32]) -> Result<Vec<[f32; 3]>, GeometryError> {
    expect_length("ray map", depth.len() * 6, rays.len())?;
    let points = rays.as_chunks::<6>().0.iter().zip(depth);
    // In f32, one rounding per step, as the network itself would.
    Ok(points.map(|([dx, dy, dz, ox, oy, oz], z)| [ox + z * dx, oy + z * dy, oz + z * dz]).collect())
}

/// Rays of the four corner pixels (0, 0), (W-1, 0), (0, H-1), (W-1, H-1) of a picture, whole-number pixel centres: for each
/// `R K^-1 (u, v, 1)` and the camera's centre, six numbers in the world. Direction is linear in u and v, so bilinear
/// interpolation between the corners gives every pixel's ray, and `X = origin + depth * direction` is
/// [`points_from_depth`].
///
/// # Errors
/// Intrinsics without inverse.
pub fn corner_rays(camera: &Camera, [height, width]: [usize; 2]) -> Result<[f32; 24], GeometryError> {
    let inverse = invert_intrinsics(&camera.intrinsics)?;
    let Rigid { rotation, translation } = Rigid::from_rows(&camera.extrinsics).inverse();
    let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
    let mut rays = [0.0; 24];
    for (ray, [u, v]) in rays.chunks_exact_mut(6).zip([[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]]) {
        let direction = rotation * (inverse * DVec3::new(u, v, 1.0));
        ray[..3].copy_from_slice(&direction.as_vec3().to_array());
        ray[3..].copy_from_slice(&translation.as_vec3().to_array());
    }
    Ok(rays)
}

/// Image coordinates and depth (u, v, z) of a world point; u and v are meaningless where z <= 0.
///
/// With [`PixelCentre::Half`] the result is in index coordinates too: the centre of the pixel (j, i) gives (j, i).
#[must_use]
pub fn project(point: [f32; 3], camera: &Camera, pixel: PixelCentre) -> [f32; 3] {
    let Rigid { rotation, translation } = Rigid::from_rows(&camera.extrinsics);
    let seen = rotation * DVec3::from(point.map(f64::from)) + translation;
    let image = matrix3(&camera.intrinsics) * seen;
    [image.x / image.z - pixel.offset(), image.y / image.z - pixel.offset(), seen.z].map(|v| v as f32)
}

/// Intrinsics of a picture resized from one size to another, each `[height, width]` (`spec/da3.md` 3): row 0 times the ratio of
/// widths, row 1 times that of heights.
#[must_use]
pub fn resize_intrinsics(intrinsics: &Matrix3, from: [usize; 2], to: [usize; 2]) -> Matrix3 {
    let ratio = |k: usize| to[k] as f64 / from[k] as f64;
    let scale = |row: [f32; 3], by: f64| row.map(|v| (f64::from(v) * by) as f32);
    [scale(intrinsics[0], ratio(1)), scale(intrinsics[1], ratio(0)), intrinsics[2]]
}

pub(crate) fn expect_length(what: &'static str, expected: usize, found: usize) -> Result<(), GeometryError> {
    if expected == found { Ok(()) } else { Err(GeometryError::LengthMismatch { what, expected, found }) }
}

pub(crate) fn invert_intrinsics(intrinsics: &Matrix3) -> Result<DMat3, GeometryError> {
    let matrix = matrix3(intrinsics);
    let determinant = matrix.determinant();
    if determinant.is_finite() && determinant != 0.0 {
        Ok(matrix.inverse())
    } else {
        Err(GeometryError::InvalidCamera { view: 0, reason: "its intrinsics have no inverse" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera {
        // A quarter turn about y, centre (5, 0, 0).
        extrinsics: [[0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, -5.0]],
        intrinsics: [[2.0, 0.0, 1.5], [0.0, 4.0, 1.0], [0.0, 0.0, 1.0]],
    };

    #[test]
    fn projection_undoes_unprojection() {
        let c2w = crate::invert_pose(&CAMERA.extrinsics);
        let depth: Vec<f32> = (1..=6).map(|k| k as f32).collect();
        for pixel in [PixelCentre::Whole, PixelCentre::Half] {
            let points = points_from_depth(&depth, [2, 3], &CAMERA.intrinsics, &c2w, pixel).unwrap();
            for (k, point) in points.iter().enumerate() {
                let [u, v, z] = project(*point, &CAMERA, pixel);
                assert!((u - (k % 3) as f32).abs() < 1e-5 && (v - (k / 3) as f32).abs() < 1e-5);
                assert!((z - depth[k]).abs() < 1e-5);
            }
        }
        // By hand: pixel (0, 0) at whole numbers, depth 1: camera point (-0.75, -0.25, 1), world (5 + 1, -0.25, 0.75).
        let points = points_from_depth(&depth, [2, 3], &CAMERA.intrinsics, &c2w, PixelCentre::Whole).unwrap();
        assert_eq!(points[0], [6.0, -0.25, 0.75]);
    }

    #[test]
    fn wrong_lengths_and_intrinsics_are_errors() {
        let identity = crate::IDENTITY_POSE;
        let short = points_from_depth(&[1.0], [1, 2], &CAMERA.intrinsics, &identity, PixelCentre::Half);
        assert!(matches!(short, Err(GeometryError::LengthMismatch { expected: 2, found: 1, .. })));
        let flat = points_from_depth(&[1.0], [1, 1], &[[0.0; 3]; 3], &identity, PixelCentre::Half);
        assert!(matches!(flat, Err(GeometryError::InvalidCamera { .. })));
        assert!(points_from_rays(&[0.0; 7], &[1.0]).is_err());
    }

    #[test]
    fn rays_start_at_their_origin() {
        let points = points_from_rays(&[1.0, 2.0, 3.0, 10.0, 20.0, 30.0], &[2.0]).unwrap();
        assert_eq!(points, [[12.0, 24.0, 36.0]]);
    }

    #[test]
    fn intrinsics_follow_the_picture() {
        let resized = resize_intrinsics(&CAMERA.intrinsics, [2, 3], [4, 3]);
        assert_eq!(resized, [[2.0, 0.0, 1.5], [0.0, 8.0, 2.0], [0.0, 0.0, 1.0]]);
    }
}
