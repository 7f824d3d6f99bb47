//! The layout that newer trainers share (`omnix-data`'s `sets/shared.rs`), with tracks: image number = camera * frames + frame, each
//! camera a video of its own, all at the same moments. Paths are those of [`POINTS`] random pixels of every image, half of them on
//! what moves where something does.

use omnix_data::{Flag, Motion, Sample, SampleParts, Time, Tracks, Unit, sets};
use omnix_geometry::Camera;
use rayon::prelude::*;

use super::files::{Files, Take};
use crate::cast::{Geometry, Hit};
use crate::error::ScenesError;
use crate::labels::{is_outside, is_seen};
use crate::random::Random;
use crate::view::View;

/// Followed points of an image, where a scene has few images, and of all images together at most.
const POINTS: usize = 64;
const MOST: usize = 8192;

/// What is kept of an image until the scene is written as a whole.
pub(super) struct Kept {
    view: View,
    frame: usize,
    camera: usize,
    colours: Vec<u8>,
    depth: Vec<f32>,
    moving: Vec<Flag>,
    points: Vec<Hit>,
}

/// Takes of an image what its scene needs: hits are six times as large as colours and depth.
pub(super) fn keep(take: Take, images: usize, random: &Random) -> Kept {
    let mut random = random.fork("points").at(take.frame).at(take.camera);
    let moving: Vec<usize> = (0..take.hits.len()).filter(|&pixel| take.moving[pixel]).collect();
    let count = POINTS.min(MOST / images.max(1)).max(1);
    let pixel = |k: usize| {
        if k.is_multiple_of(2) && !moving.is_empty() { *random.pick(&moving) } else { random.below(take.hits.len()) }
    };
    Kept {
        points: (0..count).map(pixel).filter_map(|pixel| take.hits[pixel]).collect(),
        depth: take.hits.iter().map(|hit| hit.map_or(f32::NAN, |hit| hit.t as f32)).collect(),
        moving: take.moving.into_iter().map(Flag::from).collect(),
        view: take.view,
        frame: take.frame,
        camera: take.camera,
        colours: take.colours,
    }
}

/// Writes the images of a whole scene.
pub(super) fn scene(
    files: &Files,
    mut kept: Vec<Kept>,
    states: &[Geometry],
    frame_seconds: f64,
) -> Result<(), ScenesError> {
    kept.sort_by_key(|image| (image.camera, image.frame));
    let tracks = tracks(&kept, states);
    let time = |image: &Kept| Time {
        video: image.camera as u32,
        frame: image.frame as u32,
        moment: image.frame as u32,
        seconds: Some(image.frame as f64 * frame_seconds),
    };
    let camera = |image: &Kept| Camera { extrinsics: image.view.extrinsics(), intrinsics: image.view.intrinsics() };
    let size = kept.first().map_or([0, 0], |image| image.view.size);
    let (times, cameras) = (kept.iter().map(time).collect(), kept.iter().map(camera).collect());
    let (mut images, mut depth, mut moving) = (Vec::new(), Vec::new(), Vec::new());
    for image in kept {
        images.extend(image.colours);
        depth.extend(image.depth);
        moving.extend(image.moving);
    }
    let sample = Sample::new(SampleParts {
        size: size.map(|v| v as u32),
        images,
        times,
        cameras,
        depth: Some(depth),
        moving: Some(moving),
        motion: Motion::Tracks(tracks),
        unit: Unit::Metre,
    })?;
    sets::shared::write(&sample, &files.folder, &[])?;
    files.digest_all()
}

/// Where the chosen points of all images are at the times of all images, and which of these show them.
fn tracks(kept: &[Kept], states: &[Geometry]) -> Tracks {
    let points: Vec<(Hit, bool)> = kept
        .iter()
        .flat_map(|image| image.points.iter().map(|hit| (*hit, is_outside(&image.view, &states[image.frame], hit))))
        .collect();
    let of_image = |image: &Kept| {
        let state = &states[image.frame];
        let one = |(hit, outside): &(Hit, bool)| {
            let point = state.point(hit);
            let at = image.view.project(point).map_or([f32::NAN; 2], |(at, _)| at.as_vec2().to_array());
            (point.as_vec3().to_array(), Flag::from(is_seen(&image.view, state, hit, *outside)), at)
        };
        points.iter().map(one).collect::<Vec<_>>()
    };
    let all: Vec<_> = kept.par_iter().flat_map_iter(of_image).collect();
    Tracks {
        count: points.len(),
        positions: all.iter().map(|(position, ..)| *position).collect(),
        visible: all.iter().map(|(_, visible, _)| *visible).collect(),
        pixels: Some(all.iter().map(|(.., at)| *at).collect()),
    }
}
