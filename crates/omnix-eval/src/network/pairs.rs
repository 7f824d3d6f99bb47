//! Cameras: relative rotations and directions over pairs of images, and the frame in which positions are compared.

use glam::{DMat3, DVec3};
use omnix_geometry::Camera;

/// Relative translations shorter than this, in units of the mean distance, have no direction worth comparing.
const SHORT: f64 = 0.02;

/// What brings predicted positions into the truth's frame and unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// The predicted camera of the first image.
    pub(super) first: Camera,
    /// Scale of predicted lengths.
    pub(super) scale: f64,
}

impl Frame {
    /// A displacement of the prediction in the truth's frame and unit.
    pub(super) fn displacement(&self, from: [f32; 3], to: [f32; 3]) -> DVec3 {
        let step = DVec3::from(to.map(f64::from)) - DVec3::from(from.map(f64::from));
        pose(&self.first).0 * step * self.scale
    }
}

/// Rotation and translation, world to camera.
fn pose(camera: &Camera) -> (DMat3, DVec3) {
    let rows = camera.extrinsics.map(|row| row.map(f64::from));
    let rotation = DMat3::from_cols_array_2d(&rows.map(|[a, b, c, _]| [a, b, c])).transpose();
    (rotation, DVec3::from(rows.map(|row| row[3])))
}

/// Mean angles in degrees over all pairs of images: of relative rotations, and of the directions of relative translations where the true
/// one is long enough. NaN where no pair has one.
pub(super) fn angles(predicted: &[Camera], truth: &[Camera]) -> [f64; 2] {
    let (mut rotation, mut direction) = (Vec::new(), Vec::new());
    for i in 0..truth.len() {
        for j in i + 1..truth.len() {
            let (found, wanted) = (relative(&predicted[i], &predicted[j]), relative(&truth[i], &truth[j]));
            let between = found.0 * wanted.0.transpose();
            // atan2 is exact near 0, where the arc cosine of the trace is not.
            let axis = DVec3::new(
                between.y_axis.z - between.z_axis.y,
                between.z_axis.x - between.x_axis.z,
                between.x_axis.y - between.y_axis.x,
            );
            let trace = between.x_axis.x + between.y_axis.y + between.z_axis.z;
            rotation.push(axis.length().atan2(trace - 1.0));
            if wanted.1.length() > SHORT {
                // Without a direction of its own a prediction is as good as any: a right angle.
                let off =
                    if found.1.length() > 0.0 { found.1.angle_between(wanted.1) } else { std::f64::consts::FRAC_PI_2 };
                direction.push(off);
            }
        }
    }
    [rotation, direction].map(|angles| (angles.iter().sum::<f64>() / angles.len() as f64).to_degrees())
}

/// From the frame of one camera to that of another.
fn relative(from: &Camera, to: &Camera) -> (DMat3, DVec3) {
    let ((r0, t0), (r1, t1)) = (pose(from), pose(to));
    let rotation = r1 * r0.transpose();
    (rotation, t1 - rotation * t0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(degrees: f64, t: [f32; 3]) -> Camera {
        let r = DMat3::from_rotation_y(degrees.to_radians()).transpose().to_cols_array_2d();
        let extrinsics = std::array::from_fn(|i| [r[i][0] as f32, r[i][1] as f32, r[i][2] as f32, t[i]]);
        Camera { extrinsics, intrinsics: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    #[test]
    fn angles_of_pairs() {
        let truth = [camera(0.0, [0.0; 3]), camera(10.0, [0.5, 0.0, 0.0]), camera(30.0, [0.501, 0.0, 0.0])];
        let found = angles(&truth, &truth);
        assert!(found[0].abs() < 1e-4 && found[1].abs() < 1e-4, "{found:?}");
        // Nothing turns: pairs are off by 10, 30 and 20 degrees.
        let fixed = [truth[0]; 3];
        let found = angles(&fixed, &truth);
        assert!((found[0] - 20.0).abs() < 1e-4 && (found[1] - 90.0).abs() < 1e-4, "{found:?}");
        // A world turned as a whole changes no pair.
        let turned: Vec<Camera> =
            [(7.0, 0.0), (17.0, 0.5), (37.0, 0.501)].map(|(a, x)| camera(a, [x, 0.0, 0.0])).to_vec();
        assert!(angles(&turned, &truth)[0].abs() < 1e-4);
        assert!(angles(&truth[..1], &truth[..1])[0].is_nan());
    }
}
