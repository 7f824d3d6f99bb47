//! Tracks of a network over TAPVid-3D.
//!
//! In a clip, the points that its first frame shows are asked for at the pixel of that frame that they project to, truncated; in whole
//! sequences every track in its query frame at its query's place. A point's path is moved into the predicted camera of each time. The
//! network has no visibility: a point counts as predicted visible where it falls into the picture and lies no more than 3 % behind the
//! depth there.

use std::collections::BTreeMap;
use std::path::Path;

use omnix_io::Picture;

use super::clip::{Framed, see};
use super::network::{Network, Seen};
use super::paths::world_to_camera;
use super::sequence::{Progress, network_note};
use crate::EvalError;
use crate::clips::ClipRule;
use crate::files::tapvid3d::{ClipPrediction, read_pictures};
use crate::kinds::tapvid3d::{Asked, Options, count, evaluate_with};
use crate::table::Report;

/// Share of the depth at a pixel that a point may lie behind it and be visible.
const BEHIND: f64 = 0.03;

/// Runs a network over clips of TAPVid-3D and evaluates its tracks; of `options` the first rule of clips.
///
/// # Errors
/// A folder without archives, a network without trajectories or options without a rule ([`EvalError::Parameter`]),
/// [`EvalError::Nothing`] if no sequence has a result, [`EvalError::Run`].
pub fn tapvid3d(
    network: &mut dyn Network,
    data: &Path,
    options: &Options,
    progress: &mut Progress<'_>,
) -> Result<Report, EvalError> {
    if !network.has_paths() {
        let expected = "choose one with trajectories";
        return Err(EvalError::Parameter { name: "the network", value: network.name(), expected });
    }
    let options = Options { clips: options.clips.iter().take(1).copied().collect(), ..options.clone() };
    let rule = options.clips.first().copied().unwrap_or(ClipRule::Whole);
    let (total, mut done, mut outside) = (count(data, &options)? as u64, 0, 0);
    let mut report = evaluate_with(data, &options, &mut |asked| {
        let found = predict(network, asked, rule, &mut outside);
        done += 1;
        progress(done, total);
        found
    })?;
    report.notes.insert(0, network_note(&network.name()));
    report.notes.push(format!(
        "predicted visible: inside the picture, and at most {} % behind the predicted depth there",
        100.0 * BEHIND
    ));
    if outside > 0 {
        report.notes.push(format!(
            "{outside} tracks begin outside of the part of the picture that the network saw; they have no prediction"
        ));
    }
    Ok(report)
}

/// The prediction for an archive: not a number where nothing was asked for.
fn predict(
    network: &mut dyn Network,
    asked: &Asked<'_>,
    rule: ClipRule,
    outside: &mut usize,
) -> Result<ClipPrediction, EvalError> {
    let truth = asked.truth;
    let pictures = read_pictures(asked.file)?;
    EvalError::expect("pictures of a sequence", pictures.len(), truth.frames)?;
    let mut found = ClipPrediction {
        points: vec![[f64::NAN; 3]; truth.frames * truth.tracks],
        visible: vec![false; truth.frames * truth.tracks],
    };
    let pixels = truth.pixels();
    for places in rule.cut(truth.frames)?.clips {
        let decoded =
            places.iter().map(|&place| decode(&pictures[place], asked.file)).collect::<Result<Vec<_>, _>>()?;
        let framed = Framed::new(network, &decoded)?;
        let first = places.first().copied().unwrap_or(0);
        // Tracks and their pixels, by the image that they are asked for in.
        let mut queries: BTreeMap<usize, (Vec<usize>, Vec<[u32; 2]>)> = BTreeMap::new();
        for track in 0..truth.tracks {
            let (image, place) = if rule == ClipRule::Whole {
                let [x, y, _] = truth.queries[track];
                (asked.query_frames[track], [x, y])
            } else if truth.visible[first * truth.tracks + track] {
                (0, pixels[first * truth.tracks + track])
            } else {
                continue;
            };
            match framed.pixel(image, place) {
                Some(pixel) => {
                    let (tracks, pixels) = queries.entry(image).or_default();
                    tracks.push(track);
                    pixels.push(pixel);
                }
                None => *outside += 1,
            }
        }
        let seen = see(network, &framed.clip)?;
        let cameras = world_to_camera(&seen)?;
        for (image, (tracks, pixels)) in &queries {
            let paths = network.paths(*image, Some(pixels))?;
            EvalError::expect("positions of paths, [T][pixel]", paths.len(), places.len() * tracks.len())?;
            for (k, point) in paths.iter().enumerate() {
                let (time, track) = (k / tracks.len(), tracks[k % tracks.len()]);
                let point = cameras[time].apply(point.map(f64::from));
                let index = places[time] * truth.tracks + track;
                found.points[index] = point;
                found.visible[index] = shows(&seen, time, framed.clip.size, point);
            }
        }
    }
    Ok(found)
}

/// Whether an image of the clip shows a point in its camera's frame, by the predicted depth.
fn shows(seen: &Seen, image: usize, [width, height]: [u32; 2], [x, y, z]: [f64; 3]) -> bool {
    let k = seen.cameras[image].intrinsics.map(|row| row.map(f64::from));
    let (u, v) = (k[0][0] * x / z + k[0][2], k[1][1] * y / z + k[1][2]);
    if !(z > 0.0 && u >= 0.0 && v >= 0.0 && u < f64::from(width) && v < f64::from(height)) {
        return false;
    }
    let pixels = width as usize * height as usize;
    let depth = seen.depth[image * pixels + v as usize * width as usize + u as usize];
    z <= f64::from(depth) * (1.0 + BEHIND)
}

fn decode(jpeg: &[u8], path: &Path) -> Result<Picture, EvalError> {
    let decoded = image::load_from_memory_with_format(jpeg, image::ImageFormat::Jpeg);
    let rgb =
        decoded.map_err(|error| EvalError::format("TAPVid-3D clip", format!("a picture: {error}"), path))?.into_rgb8();
    Ok(Picture::new(rgb.width(), rgb.height(), rgb.into_raw()))
}
