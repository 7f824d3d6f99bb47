//! `tracks`: `exports/tracks/NNNNNN.npz`, one archive per source image, NNNNNN its index.
//!
//! T images (= times), N chosen points of the source image; of all pixels `N` reads `H,W` and `pixel` is left out.
//! * `trajectory` f32 [T,N,3]: where each point is at each time; world frame, OpenCV axes, the network's scale; NaN where a point is lost,
//!   which only those of films in windows are
//! * `pixel` i32 [N,2]: column and row in the processed picture
//! * `confidence` f32 [N]: of the path, at least 1; `theta` f32 [N]: motion score; `moving` bool [N]: whether the gate let it move
//! * `rgb` u8 [N,3]: colour of the pixel
//! * `source` i32 [1]: index of the source image
//! * `times` f64 [T]: seconds from the start of the image's video, NaN where unknown; `video`, `frame` i32 [T]
//! * `extrinsics` f32 [T,3,4]: world-to-camera; `intrinsics` f32 [T,3,3]: in pixels of the processed picture

use std::path::{Path, PathBuf};

use super::{
    format::{FileKind, Format, ImageWriter, Points},
    motion::{MotionView, MovingPoints, SourceMotion},
    npy::{Array, write_npz},
};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "tracks",
    needs_cameras: true,
    needs_motion: true,
    loses_points: true,
    files: &[FileKind::of_images(
        "exports/tracks/NNNNNN.npz",
        "trajectory f32 [T,N,3] (of all pixels [T,H,W,3]) in the world of the extrinsics, pixel i32 [N,2] column and row, confidence, theta, moving, rgb; times, cameras",
    )
    .with(Points::Network)],
    disk: |size| {
        let (count, more) = if size.all_pixels { (size.all(), 12) } else { (size.moving(), 20) };
        size.paths(count, 12, more)
    },
    memory: |size| size.path_memory(5),
    points: Some(|dir, points, _| write_points(dir, points)),
    images: Some(ImageWriter {
        write: |dir, views, image| Ok(vec![write(dir, views, image)?]),
        wants_trajectory: |_| true,
    }),
    ..Format::NONE
};

/// Writes the archive of one source image.
fn write(dir: &Path, views: &[MotionView], image: &SourceMotion<'_>) -> Result<PathBuf, IoError> {
    image.check(views, FORMAT.name)?;
    let trajectory = image.need_trajectory(FORMAT.name)?;
    let picture = &views[image.index].picture;
    let (w, h, times) = (picture.width as usize, picture.height as usize, views.len());
    let points = image.pixels.map_or(vec![h, w], |p| vec![p.len()]);
    let with = |first: Option<usize>, last: Option<usize>| -> Vec<usize> {
        first.into_iter().chain(points.iter().copied()).chain(last).collect()
    };
    let rgb = match image.pixels {
        None => picture.data.clone(),
        Some(pixels) => pixels.iter().flat_map(|&[x, y]| pixel_colour(picture, x, y)).collect(),
    };
    let mut arrays = vec![
        Array::f32("trajectory", with(Some(times), Some(3)), trajectory.iter().copied()),
        Array::f32("confidence", points.clone(), image.confidence.iter().copied()),
        Array::f32("theta", points.clone(), image.motion.iter().copied()),
        Array::bool("moving", points.clone(), image.moving),
        Array::u8("rgb", with(None, Some(3)), rgb),
        Array::i32("source", vec![1], [image.index as i32]),
        Array::f64("times", vec![times], views.iter().map(|v| v.time.time_s.unwrap_or(f64::NAN))),
        Array::i32("video", vec![times], views.iter().map(|v| v.time.video as i32)),
        Array::i32("frame", vec![times], views.iter().map(|v| v.time.frame as i32)),
        Array::f32("extrinsics", vec![times, 3, 4], views.iter().flat_map(|v| v.extrinsics).flatten()),
        Array::f32("intrinsics", vec![times, 3, 3], views.iter().flat_map(|v| v.intrinsics).flatten()),
    ];
    if let Some(pixels) = image.pixels {
        arrays.insert(1, Array::i32("pixel", vec![pixels.len(), 2], pixels.iter().flatten().map(|&v| v as i32)));
    }
    write_npz(dir.join(format!("exports/tracks/{:06}.npz", image.index)), &arrays)
}

/// Writes the archives of all source images that have a point.
fn write_points(dir: &Path, points: &MovingPoints) -> Result<Vec<PathBuf>, IoError> {
    points.check(FORMAT.name)?;
    let mut written = Vec::new();
    let mut start = 0;
    for part in points.source.chunk_by(|a, b| a == b) {
        let range = start..start + part.len();
        start = range.end;
        let index = part[0] as usize;
        let at = |time: usize| &points.positions[3 * (time * points.len() + range.start)..][..3 * part.len()];
        let trajectory: Vec<f32> = (0..points.views.len()).flat_map(at).copied().collect();
        let image = SourceMotion {
            index,
            pixels: Some(&points.pixel[range.clone()]),
            points: at(index),
            trajectory: Some(&trajectory),
            confidence: &points.confidence[range.clone()],
            motion: &points.motion[range.clone()],
            moving: &points.moving[range],
        };
        written.push(write(dir, &points.views, &image)?);
    }
    Ok(written)
}

fn pixel_colour(picture: &crate::Picture, x: u32, y: u32) -> [u8; 3] {
    let at = 3 * (y as usize * picture.width as usize + x as usize);
    [picture.data[at], picture.data[at + 1], picture.data[at + 2]]
}
