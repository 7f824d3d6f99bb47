//! Dense paths from tracks, and from what stands still.

use glam::DVec3;

use crate::rigid::{Pinhole, centre};
use crate::scene::View;
use crate::{DataError, Dense, Flag, Motion, Sample};

/// Depth of a track and of the pixel that it falls on may differ by this share.
const AGREES: f64 = 0.03;

/// Makes dense paths of a sample's tracks: in each image that shows it, a track belongs to the pixel that it falls on, if its depth
/// there agrees within 3 %. Of several on one pixel the nearest to the camera stays, of equal ones the first. All other entries are
/// unknown. A sample without tracks stays as it is.
///
/// # Errors
/// None for a sample whose tracks fit it; those of [`Sample::new`].
pub fn rasterise(sample: Sample) -> Result<Sample, DataError> {
    let Motion::Tracks(tracks) = sample.motion() else {
        return Ok(sample);
    };
    let (count, pixels) = (sample.count(), sample.pixels());
    let [width, height] = sample.size().map(f64::from);
    let mut positions = vec![[f32::NAN; 3]; count * count * pixels];
    let mut visible = vec![Flag::Unknown; count * count * pixels];
    for (source, camera) in sample.cameras().iter().enumerate() {
        let camera = Pinhole::new(camera);
        // The track of each pixel, and its depth.
        let mut chosen: Vec<Option<(usize, f64)>> = vec![None; pixels];
        for track in 0..tracks.count {
            let own = source * tracks.count + track;
            let seen = camera.w2c.apply(DVec3::from(tracks.positions[own].map(f64::from)));
            let [u, v] = camera.project(seen);
            let inside = u >= 0.0 && v >= 0.0 && u < width && v < height;
            if tracks.visible[own] != Flag::Yes || !(seen.z > 0.0 && inside) {
                continue;
            }
            let pixel = v as usize * sample.size()[0] as usize + u as usize;
            let depth = sample.depth(source).map_or(f64::NAN, |depth| f64::from(depth[pixel]));
            let agrees = depth.is_nan() || (seen.z / depth - 1.0).abs() <= AGREES;
            if agrees && chosen[pixel].is_none_or(|(_, z)| seen.z < z) {
                chosen[pixel] = Some((track, seen.z));
            }
        }
        for (pixel, chosen) in chosen.into_iter().enumerate() {
            let Some((track, _)) = chosen else {
                continue;
            };
            for time in 0..count {
                let (to, from) = ((source * count + time) * pixels + pixel, time * tracks.count + track);
                positions[to] = tracks.positions[from];
                visible[to] = tracks.visible[from];
            }
        }
    }
    let mut parts = sample.into_parts();
    parts.motion = Motion::Dense(Dense { positions, visible: Some(visible) });
    Sample::new(parts)
}

/// Dense paths of images whose pixels stand still where `still` says so, `(image, pixel)`; the others are known at their own time
/// alone, by their depth.
pub(crate) fn standing(views: &[View], still: impl Fn(usize, usize) -> bool) -> Dense {
    let count = views.len();
    let pixels = views.first().map_or(0, |view| view.size()[0] * view.size()[1]);
    let mut positions = vec![[f32::NAN; 3]; count * count * pixels];
    for (source, view) in views.iter().enumerate() {
        let to_world = view.camera.w2c.inverse();
        for (pixel, z) in view.depth.iter().flatten().enumerate().filter(|(_, z)| z.is_finite() && **z > 0.0) {
            let [u, v] = centre(pixel, view.size()[0]);
            let point = to_world.apply(view.camera.unproject(u, v, f64::from(*z))).as_vec3().to_array();
            for time in 0..count {
                if time == source || still(source, pixel) {
                    positions[(source * count + time) * pixels + pixel] = point;
                }
            }
        }
    }
    Dense { positions, visible: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Tracks, made};

    /// Tracks through the pixels of image 0 of a made sample.
    fn tracks(sample: &Sample) -> Tracks {
        let take = |time| sample.positions(0, time).unwrap();
        let seen = |time| sample.visible(0, time).unwrap();
        let count = sample.count();
        Tracks {
            count: sample.pixels(),
            positions: (0..count).flat_map(take).copied().collect(),
            visible: (0..count).flat_map(seen).copied().collect(),
            pixels: None,
        }
    }

    #[test]
    fn tracks_come_to_their_pixels() {
        let truth = made::video([28, 14], 3);
        let mut parts = truth.clone().into_parts();
        parts.motion = Motion::Tracks(tracks(&truth));
        let dense = rasterise(Sample::new(parts).unwrap()).unwrap();
        // In image 0 every pixel has its own track, whole.
        for time in 0..3 {
            assert_eq!(dense.positions(0, time), truth.positions(0, time));
            assert_eq!(dense.visible(0, time), truth.visible(0, time));
        }
        // In image 2 a track is near the true path of the pixel that it falls on, or of no pixel.
        let (found, exact) = (dense.positions(2, 0).unwrap(), truth.positions(2, 0).unwrap());
        let known: Vec<f32> = (0..truth.pixels())
            .filter(|p| found[*p][0].is_finite())
            .map(|p| (0..3).map(|k| (found[p][k] - exact[p][k]).powi(2)).sum::<f32>().sqrt())
            .collect();
        assert!(known.len() > 150, "{}", known.len());
        let near = known.iter().filter(|d| **d < 0.4).count();
        assert!(near as f64 > 0.95 * known.len() as f64, "{near} of {}", known.len());
    }

    #[test]
    fn hidden_and_disagreeing_tracks_stay_out() {
        let truth = made::video([28, 14], 1);
        let mut parts = truth.clone().into_parts();
        let mut all = tracks(&truth);
        all.visible[0] = Flag::No;
        all.visible[1] = Flag::Unknown;
        parts.depth.as_mut().unwrap()[2] *= 1.05;
        parts.motion = Motion::Tracks(all);
        let dense = rasterise(Sample::new(parts).unwrap()).unwrap();
        let own = dense.positions(0, 0).unwrap();
        assert!(own[..3].iter().all(|p| p[0].is_nan()) && own[3..].iter().all(|p| p[0].is_finite()));
    }
}
