//! What the losses of training compare with, derived from a sample (`spec/omnix.md` 11.2). The sample is normalised before.
//!
//! * [`rays`]: `[T][8 Hp][8 Wp][6]`, direction then origin in the world, as the network's ray head gives them.
//! * [`pose_codes`]: `[T][9]`, as its camera decoder gives them.
//! * [`moving_labels`]: `[T][H][W]`, and [`token_labels`]: `[T][H/14][W/14]`, whether a pixel or token moves.
//! * [`paths`]: `[T][T][H][W][3]`, where depth alone is known the own time alone.

use glam::DVec3;
use omnix_geometry::encode_pose_code;

use crate::rigid::{Pinhole, centre};
use crate::{DataError, Flag, Sample};

/// Side of a patch in pixels.
pub const PATCH: usize = 14;
/// Side of a patch in the ray maps.
const RAYS: usize = 8;
/// A larger step between consecutive images is motion, in units of the mean distance.
pub const STEP: f32 = 0.001;

/// The ray maps of the cameras: `[T][8 Hp][8 Wp][6]` for H = 14 Hp and W = 14 Wp.
///
/// Direction `R ((j - cx') / fx', (i - cy') / fy', 1)` at column j and row i, whole numbers, with the intrinsics scaled to the size of
/// the map; origin the camera's centre; both in the world.
///
/// # Errors
/// Images whose sides are not multiples of 14.
pub fn rays(sample: &Sample) -> Result<Vec<f32>, DataError> {
    let [wide, high] = patches(sample)?.map(|patches| patches * RAYS);
    let mut out = Vec::with_capacity(sample.count() * wide * high * 6);
    for camera in sample.cameras() {
        let mut camera = Pinhole::new(camera);
        let [across, down] =
            [(wide, sample.size()[0]), (high, sample.size()[1])].map(|(to, from)| to as f64 / f64::from(from));
        camera.resize([across, down]);
        let to_world = camera.w2c.inverse();
        let origin = to_world.translation.as_vec3().to_array();
        for (i, j) in (0..high).flat_map(|i| (0..wide).map(move |j| (i, j))) {
            let direction = to_world.rotation * camera.unproject(j as f64, i as f64, 1.0);
            out.extend(direction.as_vec3().to_array());
            out.extend(origin);
        }
    }
    Ok(out)
}

/// The pose code of every camera: camera-to-world translation, quaternion with w >= 0, vertical and horizontal field of view.
#[must_use]
pub fn pose_codes(sample: &Sample) -> Vec<[f32; 9]> {
    let [width, height] = sample.size();
    sample.cameras().iter().map(|camera| encode_pose_code(camera, height, width)).collect()
}

/// `[T][H][W]`: whether each pixel's point moves, by its largest step between consecutive images. Pixels without a known step take
/// the sample's own mask where `masks` says that it may be trusted (not for OmniGame), and are unknown otherwise.
#[must_use]
pub fn moving_labels(sample: &Sample, masks: bool) -> Vec<Flag> {
    let count = sample.count();
    let mut out = Vec::with_capacity(count * sample.pixels());
    for source in 0..count {
        let moving = sample.moving(source).filter(|_| masks);
        let times: Vec<_> = (0..count).filter_map(|time| sample.positions(source, time)).collect();
        out.extend((0..sample.pixels()).map(|pixel| {
            let steps = times.windows(2).map(|pair| step(pair[0][pixel], pair[1][pixel])).filter(|step| !step.is_nan());
            match steps.reduce(f32::max) {
                Some(largest) => Flag::from(largest > STEP),
                None => moving.map_or(Flag::Unknown, |moving| moving[pixel]),
            }
        }));
    }
    out
}

/// The length of a step, NaN where an end of it is unknown.
fn step(from: [f32; 3], to: [f32; 3]) -> f32 {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| to[k] - from[k]);
    (x * x + y * y + z * z).sqrt()
}

/// `[T][H/14][W/14]`: whether any pixel of a token moves; unknown where all its pixels are.
///
/// # Errors
/// Images whose sides are not multiples of 14.
pub fn token_labels(sample: &Sample, pixels: &[Flag]) -> Result<Vec<Flag>, DataError> {
    let [wide, high] = patches(sample)?;
    let width = wide * PATCH;
    let expected = sample.count() * sample.pixels();
    if pixels.len() != expected {
        return Err(DataError::Length { what: "labels", layout: "[T][H][W]", expected, found: pixels.len() });
    }
    let tokens = (0..sample.count() * high).flat_map(|row| (0..wide).map(move |column| (row, column)));
    Ok(tokens
        .map(|(row, column)| {
            let lines = (0..PATCH).map(|line| (row * PATCH + line) * width + column * PATCH);
            let mut flags =
                lines.flat_map(|start| &pixels[start..start + PATCH]).filter(|flag| **flag != Flag::Unknown);
            let known = flags.next();
            match known {
                Some(Flag::Yes) => Flag::Yes,
                Some(_) if flags.any(|flag| *flag == Flag::Yes) => Flag::Yes,
                Some(_) => Flag::No,
                None => Flag::Unknown,
            }
        })
        .collect())
}

/// `[T source][T time][H][W]` positions: the sample's own dense paths, or, where it has none, the points of its depth at their own time and
/// nothing else.
#[must_use]
pub fn paths(sample: &Sample) -> Vec<[f32; 3]> {
    let (count, pixels, width) = (sample.count(), sample.pixels(), sample.size()[0] as usize);
    if let crate::Motion::Dense(dense) = sample.motion() {
        return dense.positions.clone();
    }
    let mut out = vec![[f32::NAN; 3]; count * count * pixels];
    for (image, camera) in sample.cameras().iter().enumerate() {
        let Some(depth) = sample.depth(image) else {
            continue;
        };
        let camera = Pinhole::new(camera);
        let to_world = camera.w2c.inverse();
        let own = (image * count + image) * pixels;
        for (pixel, z) in depth.iter().enumerate().filter(|(_, z)| z.is_finite()) {
            let [u, v] = centre(pixel, width);
            let point: DVec3 = to_world.apply(camera.unproject(u, v, f64::from(*z)));
            out[own + pixel] = point.as_vec3().to_array();
        }
    }
    out
}

/// Number of patches across and down.
fn patches(sample: &Sample) -> Result<[usize; 2], DataError> {
    let [width, height] = sample.size();
    let whole = |side: u32| (side as usize).is_multiple_of(PATCH).then_some(side as usize / PATCH);
    match (whole(width), whole(height)) {
        (Some(wide), Some(high)) => Ok([wide, high]),
        _ => Err(DataError::NotPatches { width, height }),
    }
}

#[cfg(test)]
mod tests {
    use omnix_geometry::{Camera, IDENTITY_POSE};

    use super::*;
    use crate::{Dense, Motion, SampleParts, Time, Unit};

    /// Two images of 14 x 28 pixels in front of a wall at depth 2; the paths as given, one position for all pixels of a map.
    fn sample(maps: Option<[[f32; 3]; 4]>) -> Sample {
        let (count, pixels) = (2, 14 * 28);
        let intrinsics = [[14.0, 0.0, 7.0], [0.0, 28.0, 14.0], [0.0, 0.0, 1.0]];
        let dense = |maps: [[f32; 3]; 4]| Dense {
            positions: maps.iter().flat_map(|position| vec![*position; pixels]).collect(),
            visible: None,
        };
        Sample::new(SampleParts {
            size: [14, 28],
            images: vec![0; count * pixels * 3],
            times: vec![Time::default(); count],
            cameras: vec![Camera { extrinsics: IDENTITY_POSE, intrinsics }; count],
            depth: Some(vec![2.0; count * pixels]),
            moving: Some((0..count * pixels).map(|k| Flag::from(k % pixels == 0)).collect()),
            motion: maps.map_or(Motion::Unknown, |maps| Motion::Dense(dense(maps))),
            unit: Unit::MeanDistance,
        })
        .unwrap()
    }

    #[test]
    fn rays_are_those_of_the_resized_camera() {
        let rays = rays(&sample(None)).unwrap();
        assert_eq!(rays.len(), 2 * 8 * 16 * 6);
        // Map 8 x 16: fx = 8, cx = 4, fy = 16, cy = 8.
        assert_eq!(rays[..6], [-0.5, -0.5, 1.0, 0.0, 0.0, 0.0]);
        let at = (10 * 8 + 6) * 6;
        assert_eq!(rays[at..at + 3], [0.25, 0.125, 1.0]);
    }

    #[test]
    fn labels_follow_the_paths_and_else_the_masks() {
        let unknown = [f32::NAN; 3];
        // Image 0 steps by less, image 1 by more than the least step.
        let known = sample(Some([[0.0; 3], [0.0, 0.0009, 0.0], [0.0; 3], [0.0, 0.0011, 0.0]]));
        let labels = moving_labels(&known, true);
        assert!(
            labels[..392].iter().all(|flag| *flag == Flag::No) && labels[392..].iter().all(|flag| *flag == Flag::Yes)
        );
        let lost = sample(Some([[0.0; 3], unknown, unknown, [0.0; 3]]));
        let labels = moving_labels(&lost, true);
        assert_eq!(token_labels(&lost, &labels).unwrap(), [Flag::Yes, Flag::No, Flag::Yes, Flag::No]);
        let labels = moving_labels(&lost, false);
        assert_eq!(token_labels(&lost, &labels).unwrap(), [Flag::Unknown; 4]);
        assert!(matches!(token_labels(&lost, &labels[1..]), Err(DataError::Length { .. })));
    }

    #[test]
    fn depth_alone_gives_the_own_time() {
        let paths = paths(&sample(None));
        // The last pixel of image 1: column 13, row 27.
        assert_eq!(paths[4 * 392 - 1], [2.0 * 6.5 / 14.0, 2.0 * 13.5 / 28.0, 2.0]);
        assert!(paths[392..3 * 392].iter().all(|position| position[0].is_nan()));
    }
}
