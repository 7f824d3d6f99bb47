//! Gaussians of the world from what a Gaussian head says of the pixels of a view (`spec/da3.md` section 11).
//!
//! A pixel has [`GAUSSIAN_NUMBERS`] numbers: its shift in pixels (2), scale (3), quaternion (4), colour coefficients (3 colours of 9), a
//! shift of its depth, and its density before the sigmoid. Colours are in the real spherical harmonics of 3DGS's viewers, up to degree 2.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::SMatrix;

use crate::GeometryError;
use crate::camera::Camera;
use crate::pose::{Rigid, matrix3, quaternion_from_rotation, rotation_from_quaternion};
use crate::unproject::{expect_length, invert_intrinsics};

/// Numbers of a pixel.
pub const GAUSSIAN_NUMBERS: usize = 38;
/// The number of a pixel that is the shift of its depth, in the unit of the depth.
pub const GAUSSIAN_DEPTH_SHIFT: usize = 36;
/// Coefficients of a colour: degrees 0 to 2.
pub const HARMONICS: usize = 9;

/// Bounds of a Gaussian's size, in tenths of a pixel at its depth.
const SIZES: [f64; 2] = [1e-5, 30.0];
/// What coefficients of degree 0, 1 and 2 are multiplied by.
const DEGREES: [f64; 3] = [1.0, 0.025, 0.00625];

/// What a head says of a view. Maps are row-major.
#[derive(Clone, Copy, Debug)]
pub struct GaussianMaps<'a> {
    /// `[height, width, GAUSSIAN_NUMBERS]`.
    pub numbers: &'a [f32],
    /// Depth along the camera's axis, `[height, width]`; here it is taken for the distance along the ray, as the networks were trained.
    pub depth: &'a [f32],
    /// Height and width.
    pub size: [usize; 2],
    /// Pose and intrinsics in pixels of these maps.
    pub camera: Camera,
}

/// A Gaussian of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Centre.
    pub mean: [f32; 3],
    /// Standard deviations along its axes.
    pub scale: [f32; 3],
    /// Turn of its axes. The four numbers as the reference stores them, and as its files hold them where 3DGS has w first.
    pub rotation: [f32; 4],
    /// Coefficients of red, green and blue.
    pub harmonics: [[f32; HARMONICS]; 3],
    /// Opacity before the sigmoid.
    pub density: f32,
}

impl GaussianMaps<'_> {
    /// The Gaussians of all pixels, row by row, one at a time.
    ///
    /// # Errors
    /// Maps of other lengths than the size says, or a camera that cannot be inverted.
    pub fn world(&self) -> Result<impl Iterator<Item = Gaussian> + '_, GeometryError> {
        let [height, width] = self.size;
        expect_length("depth map", height * width, self.depth.len())?;
        expect_length("Gaussian map", height * width * GAUSSIAN_NUMBERS, self.numbers.len())?;
        let view = View::new(&self.camera)?;
        let pixels = self.numbers.chunks_exact(GAUSSIAN_NUMBERS).zip(self.depth).enumerate();
        Ok(pixels.map(move |(at, (numbers, depth))| view.gaussian([at / width, at % width], numbers, *depth)))
    }
}

/// What is the same for all pixels of a view.
struct View {
    /// Camera to world.
    rotation: DMat3,
    centre: DVec3,
    rays: DMat3,
    /// A tenth of the sum of a pixel's width and height at depth 1.
    pixel: f64,
    turn: SMatrix<f64, HARMONICS, HARMONICS>,
}

impl View {
    fn new(camera: &Camera) -> Result<Self, GeometryError> {
        let Rigid { rotation, translation } = Rigid::from_rows(&camera.extrinsics).inverse();
        let [fx, fy] = [camera.intrinsics[0][0], camera.intrinsics[1][1]].map(f64::from);
        Ok(Self {
            rotation,
            centre: translation,
            rays: invert_intrinsics(&camera.intrinsics)?,
            pixel: 0.1 * (1.0 / fx + 1.0 / fy),
            turn: turned_harmonics(&rotation)?,
        })
    }

    fn gaussian(&self, [row, column]: [usize; 2], numbers: &[f32], depth: f32) -> Gaussian {
        let number = |i: usize| f64::from(numbers[i]);
        let depth = f64::from(depth) + number(GAUSSIAN_DEPTH_SHIFT);
        let place = DVec2::new(column as f64, row as f64) + DVec2::new(number(0), number(1)) + 0.5;
        let direction = self.rotation * (self.rays * place.extend(1.0)).normalize();
        let mean = self.centre + direction * depth;
        let size = |i: usize| (SIZES[0] + (SIZES[1] - SIZES[0]) * sigmoid(number(2 + i))) * depth * self.pixel;
        Gaussian {
            mean: mean.as_vec3().to_array(),
            scale: std::array::from_fn(|i| size(i) as f32),
            rotation: self.turned(std::array::from_fn(|i| number(5 + i))),
            harmonics: std::array::from_fn(|colour| self.colours(&numbers[9 + HARMONICS * colour..][..HARMONICS])),
            density: numbers[GAUSSIAN_NUMBERS - 1],
        }
    }

    /// A quaternion of the head, which is read as (w, x, y, z) rotated by one: a quirk of the reference that its networks learned.
    fn turned(&self, q: [f64; 4]) -> [f32; 4] {
        let length = q.iter().map(|v| v * v).sum::<f64>().sqrt() + 1e-8;
        let q = [q[3], q[0], q[1], q[2]].map(|v| (v / length) as f32);
        let world = self.rotation * matrix3(&rotation_from_quaternion(q));
        quaternion_from_rotation(&world.transpose().to_cols_array_2d().map(|row| row.map(|v| v as f32)))
    }

    fn colours(&self, coefficients: &[f32]) -> [f32; HARMONICS] {
        let mut own = SMatrix::<f64, HARMONICS, 1>::zeros();
        for (i, coefficient) in coefficients.iter().enumerate() {
            own[i] = f64::from(*coefficient) * DEGREES[i.isqrt()];
        }
        let turned = self.turn * own;
        std::array::from_fn(|i| turned[i] as f32)
    }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The real spherical harmonics of degrees 0 to 2 as 3DGS has them (its signs included).
fn harmonics(direction: DVec3) -> [f64; HARMONICS] {
    let DVec3 { x, y, z } = direction;
    const ONE: f64 = 0.488_602_511_902_919_9;
    [
        0.282_094_791_773_878_14,
        -ONE * y,
        ONE * z,
        -ONE * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * z * z - x * x - y * y),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (x * x - y * y),
    ]
}

/// The matrix that takes the coefficients of f to those of d ↦ f(Rᵀ d): solved from nine directions, which is exact, since what
/// is turned is of the same degrees.
fn turned_harmonics(rotation: &DMat3) -> Result<SMatrix<f64, HARMONICS, HARMONICS>, GeometryError> {
    // No cone or plane holds all of them.
    const DIRECTIONS: [[f64; 3]; HARMONICS] = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [-1.0, 0.3, 0.2],
        [0.2, -1.0, 0.3],
        [0.3, 0.2, -1.0],
        [1.0, 1.0, 0.2],
        [0.2, 1.0, 1.0],
        [1.0, 0.2, 1.0],
    ];
    let back = rotation.transpose();
    let mut here = SMatrix::<f64, HARMONICS, HARMONICS>::zeros();
    let mut there = here;
    for (row, direction) in DIRECTIONS.into_iter().enumerate() {
        let direction = DVec3::from_array(direction).normalize();
        let (a, b) = (harmonics(direction), harmonics((back * direction).normalize()));
        for (column, (a, b)) in a.into_iter().zip(b).enumerate() {
            (here[(row, column)], there[(row, column)]) = (a, b);
        }
    }
    let inverse = here.try_inverse().filter(|_| there.iter().all(|v| v.is_finite()));
    let reason = "its rotation is not finite";
    Ok(inverse.ok_or(GeometryError::InvalidCamera { view: 0, reason })? * there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::IDENTITY_POSE;

    const CAMERA: Camera =
        Camera { extrinsics: IDENTITY_POSE, intrinsics: [[50.0, 0.0, 1.0], [0.0, 100.0, 0.5], [0.0, 0.0, 1.0]] };

    #[test]
    fn a_pixel_becomes_a_gaussian_on_its_ray() {
        let mut numbers = [0.0f32; 2 * GAUSSIAN_NUMBERS];
        // The second pixel: half a column to the left, a step back.
        let second = &mut numbers[GAUSSIAN_NUMBERS..];
        (second[0], second[1], second[GAUSSIAN_DEPTH_SHIFT], second[37]) = (-0.5, 0.0, 1.0, 3.0);
        second[8] = 2.0;
        let maps = GaussianMaps { numbers: &numbers, depth: &[1.0, 2.0], size: [1, 2], camera: CAMERA };
        let found: Vec<Gaussian> = maps.world().unwrap().collect();
        assert_eq!(found.len(), 2);
        assert_eq!((found[1].mean, found[1].density), ([0.0, 0.0, 3.0], 3.0));
        let size = (1e-5 + (30.0 - 1e-5) * 0.5) * 3.0 * 0.1 * (1.0 / 50.0 + 1.0 / 100.0);
        assert!(found[1].scale.iter().all(|s| (f64::from(*s) - size).abs() < 1e-6), "{:?}", found[1].scale);
        // (q3, q0, q1, q2) read as x, y, z, w: a half turn about x.
        assert_eq!(found[1].rotation.map(|v| v.abs().round()), [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn turned_colours_are_seen_from_turned_directions() {
        let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
        let turn = turned_harmonics(&rotation).unwrap();
        let own = SMatrix::<f64, HARMONICS, 1>::from_fn(|i, _| (i as f64 * 0.37).sin());
        let turned = turn * own;
        let value = |coefficients: &SMatrix<f64, HARMONICS, 1>, direction| {
            harmonics(direction).iter().zip(coefficients.iter()).map(|(y, c)| y * c).sum::<f64>()
        };
        for direction in [DVec3::new(0.3, -0.7, 0.1), DVec3::new(-1.0, 0.1, 2.0)].map(DVec3::normalize) {
            let (seen, expected) = (value(&turned, direction), value(&own, rotation.transpose() * direction));
            assert!((seen - expected).abs() < 1e-12, "{seen} {expected}");
        }
        // Degrees stay apart.
        assert!((1..HARMONICS).all(|i| turn[(0, i)].abs() < 1e-12 && turn[(i, 0)].abs() < 1e-12));
    }

    #[test]
    fn maps_of_another_size_are_refused() {
        let maps = GaussianMaps { numbers: &[0.0; GAUSSIAN_NUMBERS], depth: &[1.0, 2.0], size: [1, 2], camera: CAMERA };
        assert!(matches!(maps.world().err(), Some(GeometryError::LengthMismatch { found: 38, .. })));
    }
}
