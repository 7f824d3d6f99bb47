//! Ground truth as training wants it (`spec/omnix.md` 11.1): relative to the first camera, in units of the mean distance.
//!
//! The world becomes the frame of the first camera: `E_i <- E_i inverse(E_0)`, positions `p <- E_0 p`. Then depth, translations and
//! positions are divided by m, the mean distance from that camera of the own-time points of all valid pixels of all images. A
//! pixel's own-time point is its position at the time of its own image, or, where no path says it, its depth along its ray. Samples
//! without any such point (cameras alone) are moved and not scaled.

use glam::DVec3;

use crate::rigid::{Pinhole, Rigid, centre};
use crate::{DataError, Motion, Sample, Unit};

/// A sample in the frame of its first camera, and the length by which it was divided.
#[derive(Debug, Clone, PartialEq)]
pub struct Normalised {
    /// The sample.
    pub sample: Sample,
    /// The mean distance in the sample's former unit; none where nothing gave a length, and the unit is unchanged.
    pub distance: Option<f64>,
}

/// Moves the world into the first camera's frame and divides all lengths by the mean distance of the points.
///
/// # Errors
/// Points whose mean distance is 0 or too small or large for f32.
pub fn normalise(sample: Sample) -> Result<Normalised, DataError> {
    let first = Rigid::from_pose(&sample.cameras()[0].extrinsics);
    let distance = mean_distance(&sample);
    let scale = match distance {
        None => 1.0,
        Some(mean) if mean > f64::from(f32::MIN_POSITIVE) && mean < f64::from(f32::MAX) => mean.recip(),
        Some(mean) => return Err(DataError::NoScale { mean }),
    };
    let mut parts = sample.into_parts();
    let to_first = first.inverse();
    for camera in &mut parts.cameras {
        let mut pose = Rigid::from_pose(&camera.extrinsics).after(to_first);
        pose.translation *= scale;
        camera.extrinsics = pose.to_pose();
    }
    for depth in parts.depth.iter_mut().flatten() {
        *depth = (f64::from(*depth) * scale) as f32;
    }
    let positions = match &mut parts.motion {
        Motion::Unknown => &mut Vec::new(),
        Motion::Dense(dense) => &mut dense.positions,
        Motion::Tracks(tracks) => &mut tracks.positions,
    };
    for position in positions {
        *position = (first.apply(DVec3::from(position.map(f64::from))) * scale).as_vec3().to_array();
    }
    if distance.is_some() {
        parts.unit = Unit::MeanDistance;
    }
    Ok(Normalised { sample: Sample::new(parts)?, distance })
}

/// The mean distance from the first camera of the own-time points of all valid pixels; none without any.
#[must_use]
pub fn mean_distance(sample: &Sample) -> Option<f64> {
    let first = Rigid::from_pose(&sample.cameras()[0].extrinsics);
    let width = sample.size()[0] as usize;
    let (mut sum, mut count) = (0.0, 0u64);
    for (image, camera) in sample.cameras().iter().enumerate() {
        let camera = Pinhole::new(camera);
        let to_first = first.after(camera.w2c.inverse());
        let (own, depth) = (sample.positions(image, image), sample.depth(image));
        for pixel in (0..sample.pixels()).filter(|pixel| sample.valid(image, *pixel)) {
            let point = match (own.map(|own| own[pixel]), depth) {
                (Some(own), _) if own[0].is_finite() => first.apply(DVec3::from(own.map(f64::from))),
                (_, Some(depth)) => {
                    let [u, v] = centre(pixel, width);
                    to_first.apply(camera.unproject(u, v, f64::from(depth[pixel])))
                }
                _ => continue,
            };
            sum += point.length();
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use omnix_geometry::Camera;

    use super::*;
    use crate::{Dense, SampleParts, Time};

    /// Two images of one wall at depth 4 and 8, the second camera two units to the right, both turned by a quarter about y.
    fn wall() -> SampleParts {
        let turned = |x: f32| [[0.0, 0.0, -1.0, x], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 5.0]];
        let intrinsics = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]];
        SampleParts {
            size: [1, 1],
            images: vec![0; 6],
            times: vec![Time::default(); 2],
            cameras: [1.0, -1.0].map(|x| Camera { extrinsics: turned(x), intrinsics }).to_vec(),
            depth: Some(vec![4.0, 8.0]),
            moving: None,
            motion: Motion::Unknown,
            unit: Unit::Metre,
        }
    }

    #[test]
    fn the_first_camera_is_the_world_and_the_mean_distance_is_one() {
        let normalised = normalise(Sample::new(wall()).unwrap()).unwrap();
        // The points are (0, 0, 4) and (2, 0, 8) in the first camera's frame.
        let mean = (4.0 + 68f64.sqrt()) / 2.0;
        assert!((normalised.distance.unwrap() - mean).abs() < 1e-9);
        let parts = normalised.sample.parts();
        assert_eq!(parts.cameras[0].extrinsics, omnix_geometry::IDENTITY_POSE);
        let second = parts.cameras[1].extrinsics;
        assert!((f64::from(second[0][3]) + 2.0 / mean).abs() < 1e-6, "{second:?}");
        assert!((f64::from(parts.depth.as_ref().unwrap()[1]) - 8.0 / mean).abs() < 1e-6);
        assert_eq!(parts.unit, Unit::MeanDistance);
        assert!((mean_distance(&normalised.sample).unwrap() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn paths_win_over_depth_and_invalid_pixels_do_not_count() {
        let mut parts = wall();
        // In the world: the first camera's frame turned; the point 3 in front of the first camera.
        parts.motion = Motion::Dense(Dense { positions: vec![[-2.0, 0.0, 1.0]; 4], visible: None });
        parts.depth = Some(vec![4.0, f32::NAN]);
        let normalised = normalise(Sample::new(parts).unwrap()).unwrap();
        assert_eq!(normalised.distance, Some(3.0));
        let own = normalised.sample.positions(0, 0).unwrap()[0];
        assert!((own[2] - 1.0).abs() < 1e-6 && own[0].abs() < 1e-6, "{own:?}");
    }

    #[test]
    fn cameras_alone_keep_their_unit() {
        let mut parts = wall();
        parts.depth = None;
        let normalised = normalise(Sample::new(parts).unwrap()).unwrap();
        assert_eq!((normalised.distance, normalised.sample.unit()), (None, Unit::Metre));
        assert_eq!(normalised.sample.cameras()[1].extrinsics[0][3], -2.0);
    }

    #[test]
    fn lengths_beyond_f32_are_an_error() {
        let mut parts = wall();
        parts.depth = Some(vec![f32::MIN_POSITIVE / 8.0, f32::NAN]);
        let error = normalise(Sample::new(parts).unwrap()).unwrap_err();
        assert!(matches!(error, DataError::NoScale { .. }), "{error}");
    }
}
