//! `colmap`: a model of COLMAP, binary and as text (COLMAP's documentation, "Output format"), for COLMAP itself, 3D Gaussian splatting
//! and everything else that starts from one.
//!
//! A PINHOLE camera for each image, at the size and under the name of the picture it was made of. Points are few and spread over each
//! picture: one for each cell that shows none of an earlier image, where the network is surest. Their tracks are the later images in which the
//! point lies where its depth says, so of several images those points stay that two agree on: what moves drops out. An observation is the
//! point's projection; its error is therefore 0.

mod model;
mod points;
mod write;

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use super::camera::Camera;
use super::format::{FileKind, Format, Points};
use super::frame::{FrameResult, RunSummary, Sink};
use crate::IoError;
use model::Image;
use points::Cloud;

/// The two forms: folder, and ending of its files.
const BINARY: &str = "exports/colmap/sparse/0";
const TEXT: &str = "exports/colmap/text";

pub(super) const FORMAT: Format = Format {
    name: "colmap",
    needs_cameras: true,
    states_source_lenses: true,
    files: &[
        FileKind::one(
            "exports/colmap/sparse/0/cameras.bin",
            "PINHOLE cameras at the size of the source pictures, corner of the first pixel at 0",
        ),
        FileKind::one("exports/colmap/sparse/0/images.bin", "world-to-camera of every image, and where it sees points"),
        FileKind::one("exports/colmap/sparse/0/points3D.bin", "points that images agree on, with their tracks")
            .with(Points::DepthAndCamera),
        FileKind::one("exports/colmap/text/cameras.txt", "the same as text"),
        FileKind::one("exports/colmap/text/images.txt", "the same as text"),
        FileKind::one("exports/colmap/text/points3D.txt", "the same as text").with(Points::DepthAndCamera),
    ],
    // A point takes 63 bytes and 8 for each observation, an observation 24; as text about twice that.
    disk: |size| size.images.saturating_mul(1000 + 3 * points::CELLS as u64 * 200),
    memory: |size| size.images.saturating_mul(points::CELLS as u64 * 200),
    frames: Some(|dir, _| {
        Ok(Box::new(ColmapSink { dir: dir.to_owned(), images: Vec::new(), cloud: Cloud::default() }))
    }),
    ..Format::NONE
};

struct ColmapSink {
    dir: PathBuf,
    images: Vec<Image>,
    cloud: Cloud,
}

impl Sink for ColmapSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        let camera = Camera::of(frame, FORMAT.name)?;
        let missing = |missing| IoError::MissingField { export: FORMAT.name, missing, index: frame.index };
        let extrinsics = frame.extrinsics.ok_or_else(|| missing("extrinsics"))?.map(|row| row.map(f64::from));
        let intrinsics = frame.intrinsics.ok_or_else(|| missing("intrinsics"))?;
        let column = |c: usize| DVec3::new(extrinsics[0][c], extrinsics[1][c], extrinsics[2][c]);
        let rotation = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
        let source = frame.source();
        let number = self.images.len() as u32;
        let seen = self.cloud.add(frame, &camera, &intrinsics, number);
        self.images.push(Image {
            size: source.size,
            pinhole: source.pinhole(&intrinsics),
            rotation: if rotation.w < 0.0 { -rotation } else { rotation },
            translation: column(3),
            seen: seen.into_iter().map(|(place, point)| (source.place(place), point)).collect(),
            name: source.name,
        });
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let Self { dir, mut images, cloud } = *self;
        if images.is_empty() {
            return Ok(Vec::new());
        }
        let points = cloud.agreed(&mut images);
        let mut written = Vec::new();
        for (folder, ending, form) in [(BINARY, "bin", write::BINARY), (TEXT, "txt", write::TEXT)] {
            let path = |name: &str| dir.join(Path::new(folder)).join(format!("{name}.{ending}"));
            written.push(form.cameras(path("cameras"), &images)?);
            written.push(form.images(path("images"), &images)?);
            written.push(form.points(path("points3D"), &points)?);
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests;
