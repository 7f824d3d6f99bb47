//! `ply_seq`: the followed points at every time, a binary little-endian PLY for each, for tools that play a sequence of files.
//!
//! Vertex: x y z (float), red green blue (uchar), motion score and confidence (float), source image and its column and row (uint): 35 bytes.
//! Point k of every file is the same point.

use std::path::{Path, PathBuf};

use super::atomic;
use super::format::{FileKind, Format, Points};
use super::motion::MovingPoints;
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "ply_seq",
    needs_motion: true,
    files: &[FileKind::of_images(
        "exports/ply_seq/NNNNNN.ply",
        "the followed points at the time of image NNNNNN: x y z, red green blue, motion, confidence, image, column, row",
    )
    .with(Points::Network)],
    disk: |size| size.paths(size.moving(), VERTEX as u64, 0).saturating_add(size.images.saturating_mul(400)),
    memory: |size| size.moving().saturating_mul(VERTEX as u64),
    points: Some(|dir, points, _| write(dir, points)),
    ..Format::NONE
};

/// Bytes of a vertex.
const VERTEX: usize = 35;

fn write(dir: &Path, points: &MovingPoints) -> Result<Vec<PathBuf>, IoError> {
    points.check(FORMAT.name)?;
    if points.is_empty() {
        return Err(IoError::NoPoints { export: FORMAT.name });
    }
    let file = |time: usize| {
        let mut bytes = header(points, time).into_bytes();
        bytes.reserve(VERTEX * points.len());
        for k in 0..points.len() {
            bytes.extend(points.position(time, k).map(f32::to_le_bytes).concat());
            bytes.extend(points.colours[k]);
            bytes.extend([points.motion[k], points.confidence[k]].map(f32::to_le_bytes).concat());
            let [column, row] = points.pixel[k];
            bytes.extend([points.source[k], column, row].map(u32::to_le_bytes).concat());
        }
        atomic::write_file(dir.join(FORMAT.files[0].numbered(time)), &bytes)
    };
    (0..points.views.len()).map(file).collect()
}

fn header(points: &MovingPoints, time: usize) -> String {
    let seconds = points.views[time].time.time_s.map(|s| format!("comment time {s} s\n")).unwrap_or_default();
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment OpenCV axes: x right, y down, z forward in the first image's camera\n{seconds}\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n\
         property uchar blue\nproperty float motion\nproperty float confidence\nproperty uint image\nproperty uint column\n\
         property uint row\nend_header\n",
        points.len()
    )
}
