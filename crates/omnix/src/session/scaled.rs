//! One known distance: where the head's own results say how long it is, all results are brought to metres.

use omnix_geometry::Camera;

use super::readback::scaled_gaussians;
use crate::error::OmnixError;
use crate::event::FrameGeometry;
use crate::request::KnownDistance;

/// Metres in a unit of the network, by the depth and camera of the image that the distance was seen in.
///
/// # Errors
/// A place without depth, or places at one point.
pub(super) fn scale(known: &KnownDistance, depth: &[f32], width: usize, camera: &Camera) -> Result<f64, OmnixError> {
    let wrong = |what: &str| OmnixError::Request {
        reason: format!("the known distance in image {}: {what}; choose other places", known.image),
    };
    let [[fx, skew, cx], [_, fy, cy], _] = camera.intrinsics.map(|row| row.map(f64::from));
    let rows = depth.len() / width;
    let mut points = [[0.0; 3]; 2];
    for (point, [x, y]) in points.iter_mut().zip(known.places.map(|place| place.map(f64::from))) {
        let pixel = [(x, width), (y, rows)].map(|(place, side)| (place.round().max(0.0) as usize).min(side - 1));
        let z = f64::from(depth[pixel[1] * width + pixel[0]]);
        if !(z.is_finite() && z > 0.0) {
            return Err(wrong("there is no depth at one of its ends"));
        }
        let v = (y - cy) / fy;
        *point = [(x - cx - skew * v) / fx * z, v * z, z];
    }
    let [a, b] = points;
    let length = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt();
    let scale = known.metres / length;
    if scale.is_finite() && scale > 0.0 { Ok(scale) } else { Err(wrong("its ends are at one point")) }
}

/// A camera in a world whose unit is this many times smaller.
pub(super) fn camera(mut camera: Camera, scale: f64) -> Camera {
    camera.extrinsics.iter_mut().for_each(|row| row[3] = (f64::from(row[3]) * scale) as f32);
    camera
}

/// An image's results in metres.
pub(super) fn geometry(frame: &mut FrameGeometry, scale: f64) {
    let times = scale as f32;
    frame.depth.iter_mut().for_each(|depth| *depth *= times);
    frame.camera = frame.camera.map(|before| camera(before, scale));
    if let Some((rays, _)) = &mut frame.rays {
        rays.chunks_exact_mut(6).for_each(|ray| ray[3..].iter_mut().for_each(|origin| *origin *= times));
    }
    frame.gaussians = frame.gaussians.take().map(|numbers| scaled_gaussians(numbers, times));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_across_and_along_depth_gives_the_scale() {
        let intrinsics = [[10.0, 0.0, 2.0], [0.0, 10.0, 1.0], [0.0, 0.0, 1.0]];
        let camera = Camera { extrinsics: omnix_geometry::IDENTITY_POSE, intrinsics };
        let mut depth = vec![2.0; 4 * 3];
        depth[4 + 3] = 0.0;
        let known = |places, metres| KnownDistance { image: 0, places, metres };
        // Two pixels apart at a depth of 2 with f = 10 are 0.4 units.
        let found = scale(&known([[0.0, 1.0], [2.0, 1.0]], 1.0), &depth, 4, &camera).unwrap();
        assert!((found - 2.5).abs() < 1e-9, "{found}");
        assert!(scale(&known([[0.0, 1.0], [3.0, 1.0]], 1.0), &depth, 4, &camera).is_err());
        assert!(scale(&known([[1.0, 1.0], [1.0, 1.0]], 1.0), &depth, 4, &camera).is_err());
    }
}
