//! Paths beside pixels, depth, masks and visibility.

use glam::DVec3;
use serde::Serialize;

use super::facing::Fronts;
use super::grid::{At, at, chosen, quantile};
use crate::rigid::{Pinhole, centre};
use crate::{Flag, Motion, Sample};

/// Difference of depth, as a share, within which a point lies on the surface that an image shows.
const ON: f64 = 0.03;
/// The least difference of depth, as a share, that f32 numbers tell.
const EXACT: f64 = 2e-6;
/// A point of a still pixel that comes further than this share of its depth from its own place moves.
const STILL: f64 = 0.005;
/// Points this near to the edge of an image, in pixels, may be in or out.
const EDGE: f64 = 0.05;
/// Tracks that are looked at, at most, roughly.
const TRACKS: usize = 4000;

/// How well paths agree with the rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackErrors {
    /// Places compared with where the data set says that they are in an image.
    pub compared: usize,
    /// Median error in pixels.
    pub median: f64,
    /// 95th percentile of the same.
    pub percentile_95: f64,
    /// Largest error in pixels.
    pub most: f64,
    /// Mean offset in pixels, right and down: half a pixel both ways is another count of pixels.
    pub offset: [f64; 2],
    /// Median relative difference between the depth of visible points and of the image there.
    pub depth_median: Option<f64>,
    /// Points of pixels that are said to stand still, and move.
    pub still_but_moving: usize,
}

/// Visibility beside depth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Visibility {
    /// Flags that depth can say something about.
    pub compared: usize,
    /// Flags that contradict it.
    pub contradictions: usize,
    /// Of these: visible, and outside of the image or behind the camera.
    pub outside: usize,
    /// Visible, and behind a nearer surface.
    pub behind: usize,
    /// Hidden, inside of the image and on the surface that it shows, or in front of it.
    pub hidden: usize,
}

/// A place that the data set states: a point of the world, and where it is in an image.
pub(super) struct Place {
    pub(super) image: usize,
    pub(super) point: DVec3,
    pub(super) pixel: [f64; 2],
}

/// The places that a sample states: the own-time points of pixels, or tracks with their positions in images.
pub(super) fn places(sample: &Sample) -> Vec<Place> {
    let known = |p: &[f32; 3]| p[0].is_finite();
    let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let mut places = Vec::new();
    match sample.motion() {
        Motion::Unknown => {}
        Motion::Dense(_) => {
            let width = sample.size()[0] as usize;
            for (image, own) in (0..sample.count()).filter_map(|image| Some((image, sample.positions(image, image)?))) {
                let pixels = chosen(sample).filter(|pixel| known(&own[*pixel]));
                places.extend(pixels.map(|p| Place { image, point: wide(own[p]), pixel: centre(p, width) }));
            }
        }
        Motion::Tracks(tracks) => {
            let Some(pixels) = &tracks.pixels else {
                return places;
            };
            let step = (tracks.count / TRACKS).max(1);
            for (image, track) in (0..sample.count()).flat_map(|i| (0..tracks.count).step_by(step).map(move |t| (i, t)))
            {
                let index = image * tracks.count + track;
                let (point, pixel) = (tracks.positions[index], pixels[index].map(f64::from));
                if known(&point) && tracks.visible[index] == Flag::Yes && pixel.iter().all(|v| v.is_finite()) {
                    places.push(Place { image, point: wide(point), pixel });
                }
            }
        }
    }
    places
}

/// Measures the paths; none where the sample states no place.
pub(super) fn measure(sample: &Sample, cameras: &[Pinhole]) -> Option<TrackErrors> {
    let (mut errors, mut offset) = (Vec::new(), [0.0; 2]);
    for Place { image, point, pixel } in places(sample) {
        let seen = cameras[image].w2c.apply(point);
        let [u, v] = cameras[image].project(seen);
        let [across, down] = [u - pixel[0], v - pixel[1]];
        // Behind the camera, as far off as can be.
        let error = if seen.z > 0.0 { across.hypot(down) } else { f64::from(sample.size()[0].max(sample.size()[1])) };
        errors.push(error);
        if seen.z > 0.0 {
            offset = [offset[0] + across, offset[1] + down];
        }
    }
    if errors.is_empty() && matches!(sample.motion(), Motion::Unknown) {
        return None;
    }
    let mut depths = Vec::new();
    flags(sample, cameras, |flag, _, beside| {
        if let (Flag::Yes, Some(off)) = (flag, beside) {
            depths.push(off.abs());
        }
    });
    let count = errors.len();
    Some(TrackErrors {
        compared: count,
        median: quantile(&mut errors, 0.5),
        percentile_95: quantile(&mut errors, 0.95),
        most: errors.last().copied().unwrap_or(0.0),
        offset: offset.map(|sum| sum / count.max(1) as f64),
        depth_median: (!depths.is_empty()).then(|| quantile(&mut depths, 0.5)),
        still_but_moving: still_but_moving(sample),
    })
}

/// Points of pixels that are said to stand still, whose paths do not.
fn still_but_moving(sample: &Sample) -> usize {
    let mut count = 0;
    for source in 0..sample.count() {
        let (Some(moving), Some(own)) = (sample.moving(source), sample.positions(source, source)) else {
            continue;
        };
        let depth = sample.depth(source);
        for pixel in chosen(sample).filter(|pixel| moving[*pixel] == Flag::No) {
            let near = depth.map_or(1.0, |depth| depth[pixel]) as f64 * STILL;
            let far = |time: usize| {
                let there = sample.positions(source, time).map_or([f32::NAN; 3], |map| map[pixel]);
                (0..3).map(|k| f64::from(there[k] - own[pixel][k]).powi(2)).sum::<f64>().sqrt() > near
            };
            count += usize::from((0..sample.count()).any(far));
        }
    }
    count
}

/// Compares visibility with depth; none without both.
///
/// What hides a point may be thin: a sheet of paper on a desk. So a hidden point counts as a contradiction only where it lies on the
/// surface that the image shows as exactly as most visible points do.
pub(super) fn visibility(sample: &Sample, cameras: &[Pinhole]) -> Option<Visibility> {
    let mut told = Vec::new();
    flags(sample, cameras, |flag, inside, beside| {
        if flag != Flag::Unknown && inside.is_some() && (inside == Some(false) || beside.is_some()) {
            told.push((flag, inside == Some(true), beside));
        }
    });
    let seen = told.iter().filter(|(flag, inside, _)| *flag == Flag::Yes && *inside);
    let mut off: Vec<f64> = seen.filter_map(|(.., beside)| beside.map(f64::abs)).collect();
    let exact = if off.is_empty() { ON / 3.0 } else { (4.0 * quantile(&mut off, 0.5)).clamp(EXACT, ON / 3.0) };
    let mut found = Visibility { compared: told.len(), contradictions: 0, outside: 0, behind: 0, hidden: 0 };
    for told in told {
        match told {
            (Flag::Yes, false, _) => found.outside += 1,
            (Flag::Yes, true, Some(off)) if off > ON => found.behind += 1,
            (Flag::No, true, Some(off)) if off < exact => found.hidden += 1,
            _ => {}
        }
    }
    found.contradictions = found.outside + found.behind + found.hidden;
    (found.compared > 0).then_some(found)
}

/// Whether the surface at a pixel of a map of positions shows its back to a camera at `from`: a sheet without thickness is hidden there
/// although it lies where the camera sees it. The neighbours in the map say how it lies; one beyond an edge of depth may say it wrong.
fn faces_away(positions: &[[f32; 3]], [width, height]: [usize; 2], pixel: usize, from: DVec3) -> bool {
    let point = |pixel: usize| DVec3::from(positions[pixel].map(f64::from));
    let (column, row, here) = (pixel % width, pixel / width, point(pixel));
    let across = if column + 1 < width { point(pixel + 1) - here } else { here - point(pixel.saturating_sub(1)) };
    let down = if row + 1 < height { point(pixel + width) - here } else { here - point(pixel.saturating_sub(width)) };
    // x right and y down make z forward: away from the camera of the map.
    across.cross(down).dot(here - from) < 0.0
}

/// Calls `tell` for flags of visibility of what does not face away, with whether the point is inside of the image (none at its edge), and with its depth over the depth
/// there, less 1 (none where that is unclear).
fn flags(sample: &Sample, cameras: &[Pinhole], mut tell: impl FnMut(Flag, Option<bool>, Option<f64>)) {
    let size = sample.size().map(|side| side as usize);
    let mut look = |image: usize, position: [f32; 3], flag: Flag| {
        if !position[0].is_finite() {
            return;
        }
        let seen = cameras[image].w2c.apply(DVec3::from(position.map(f64::from)));
        let [u, v] = cameras[image].project(seen);
        let within = |margin: f64| {
            u >= margin && v >= margin && u < size[0] as f64 - margin && v < size[1] as f64 - margin && seen.z > 0.0
        };
        let inside = if within(EDGE) == within(-EDGE) { Some(within(0.0)) } else { None };
        let beside = sample.depth(image).and_then(|depth| match at(depth, size, [u, v]) {
            At::Inverse(inverse) if seen.z > 0.0 => Some(seen.z * inverse - 1.0),
            _ => None,
        });
        tell(flag, inside, beside);
    };
    match sample.motion() {
        Motion::Unknown => {}
        Motion::Dense(_) => {
            for (source, time) in (0..sample.count()).flat_map(|s| (0..sample.count()).map(move |t| (s, t))) {
                if let (Some(positions), Some(visible)) = (sample.positions(source, time), sample.visible(source, time))
                {
                    let from = cameras[time].w2c.inverse().translation;
                    let away = |pixel| visible[pixel] == Flag::No && faces_away(positions, size, pixel, from);
                    chosen(sample)
                        .filter(|pixel| !away(*pixel))
                        .for_each(|pixel| look(time, positions[pixel], visible[pixel]));
                }
            }
        }
        Motion::Tracks(tracks) => {
            let step = (tracks.count / TRACKS).max(1);
            // Where no flag says yes, no image tells which side a track is on, and its flags are held against depth all the same.
            let told = tracks.visible.contains(&Flag::Yes);
            for track in (0..tracks.count).step_by(step) {
                let fronts = Fronts::of(sample, cameras, tracks, track);
                for (image, camera) in cameras.iter().enumerate() {
                    let index = image * tracks.count + track;
                    let place = DVec3::from(tracks.positions[index].map(f64::from));
                    let front = fronts.shows(place, camera.w2c.inverse().translation).unwrap_or(!told);
                    if front || tracks.visible[index] != Flag::No {
                        look(image, tracks.positions[index], tracks.visible[index]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_shows_its_back_from_behind() {
        let size = [3, 2];
        let sheet: Vec<[f32; 3]> = (0..6).map(|p| [(p % 3) as f32 - 1.0, (p / 3) as f32, 2.0]).collect();
        for pixel in 0..6 {
            assert!(!faces_away(&sheet, size, pixel, DVec3::ZERO), "{pixel}");
            assert!(faces_away(&sheet, size, pixel, DVec3::new(0.3, 0.1, 4.0)), "{pixel}");
        }
    }
}
