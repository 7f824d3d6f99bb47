//! `ply`: all points of the world in one binary little-endian file, `points.ply`.
//!
//! Vertex: x y z (float), red green blue (uchar), confidence (float): 19 bytes. The count and the confidence threshold are known
//! only at the end, so points are spooled to an unnamed file and copied behind the header. A limit on the number keeps every
//! n/limit-th of the n points that pass, evenly and without chance.

use std::{
    io::{Read, Seek},
    path::{Path, PathBuf},
};

use super::{
    atomic::{AtomicFile, Spool},
    camera::{Camera, Point, for_each_point},
    format::{FileKind, Format, Points},
    frame::{FrameResult, RunSummary, Sink},
    options::SinkOptions,
    sample::{ConfidenceSample, percentile},
};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "ply",
    needs_cameras: true,
    files: &[FileKind::one(
        "points.ply",
        "points of all images in the world of the extrinsics: x y z, red green blue, confidence",
    )
    .with(Points::DepthAndCamera)],
    disk: |size| size.still(size.all()).saturating_mul(VERTEX_BYTES as u64),
    frames: Some(|dir, options| Ok(Box::new(PlySink::new(dir, options)?))),
    ..Format::NONE
};

const VERTEX_BYTES: usize = 19;

struct PlySink {
    path: PathBuf,
    options: SinkOptions,
    points: Spool,
    confidences: ConfidenceSample,
    images: usize,
}

impl PlySink {
    fn new(dir: &Path, options: &SinkOptions) -> Result<Self, IoError> {
        let path = dir.join("points.ply");
        let points = Spool::new(dir, path.clone())?;
        Ok(Self { path, options: options.clone(), points, confidences: ConfidenceSample::new(options.seed), images: 0 })
    }
}

impl Sink for PlySink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        let camera = Camera::of(frame, FORMAT.name)?;
        if self.options.ply_confidence_percentile.is_some() {
            self.confidences.add(frame);
        }
        for_each_point(frame, &camera, |point| self.points.put(&vertex(&point())))?;
        self.images += 1;
        Ok(())
    }

    fn finish(self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let Self { path, options, points, confidences, images } = *self;
        if images == 0 {
            return Ok(Vec::new());
        }
        let threshold = options.ply_confidence_percentile.and_then(|p| percentile(&confidences.sorted(), p));
        let total = points.len() / VERTEX_BYTES as u64;
        let mut spool = points.into_reader()?;
        let read = |e| IoError::read(&path, e);
        let mut record = [0u8; VERTEX_BYTES];
        let mut passing = total;
        if threshold.is_some() {
            passing = 0;
            for _ in 0..total {
                spool.read_exact(&mut record).map_err(read)?;
                passing += u64::from(passes(&record, threshold));
            }
            spool.rewind().map_err(read)?;
        }
        let kept = options.ply_max_points.map_or(passing, |limit| passing.min(limit as u64));
        let mut file = AtomicFile::create(path.clone())?;
        file.put(header(kept, &options, threshold, summary).as_bytes())?;
        let mut number = 0u64;
        for _ in 0..total {
            spool.read_exact(&mut record).map_err(read)?;
            if passes(&record, threshold) {
                if is_taken(number, kept, passing) {
                    file.put(&record)?;
                }
                number += 1;
            }
        }
        Ok(vec![file.commit()?])
    }
}

fn vertex(point: &Point) -> [u8; VERTEX_BYTES] {
    let mut record = [0u8; VERTEX_BYTES];
    for (to, value) in record.chunks_exact_mut(4).zip(point.position) {
        to.copy_from_slice(&value.to_le_bytes());
    }
    record[12..15].copy_from_slice(&point.colour);
    record[15..].copy_from_slice(&point.confidence.to_le_bytes());
    record
}

fn passes(record: &[u8; VERTEX_BYTES], threshold: Option<f32>) -> bool {
    let confidence = f32::from_le_bytes([record[15], record[16], record[17], record[18]]);
    threshold.is_none_or(|t| confidence >= t)
}

/// Whether point `number` of `of` is among `kept` evenly spread ones: exactly `kept` numbers are.
fn is_taken(number: u64, kept: u64, of: u64) -> bool {
    let step = |n: u64| u128::from(n) * u128::from(kept) / u128::from(of);
    step(number + 1) > step(number)
}

fn header(count: u64, options: &SinkOptions, threshold: Option<f32>, summary: &RunSummary) -> String {
    let filter = threshold.map_or("none".into(), |t| format!("confidence >= {t}"));
    let unit = options.unit.replace(['\n', '\r'], " ");
    let mut text = format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment omnix: points of all images, from depth, intrinsics and pose\n\
         comment world frame: that of the extrinsics (world-to-camera) of the same run; OpenCV axes, x right, y down, z forward\n\
         comment pixel positions are whole numbers (the centre of the top left pixel is 0,0)\n\
         comment unit of length: {unit}\n\
         comment filter: {filter}\n"
    );
    if summary.interrupted {
        text.push_str("comment the run was interrupted: these are the images finished until then\n");
    }
    text.push_str(&format!("element vertex {count}\n"));
    for (kind, names) in [("float", "x y z"), ("uchar", "red green blue"), ("float", "confidence")] {
        for name in names.split(' ') {
            text.push_str(&format!("property {kind} {name}\n"));
        }
    }
    text.push_str("end_header\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exactly_as_many_as_asked_and_spread() {
        for (kept, of) in [(3u64, 10u64), (10, 10), (1, 7), (0, 5), (999, 1000)] {
            let taken: Vec<u64> = (0..of).filter(|&n| is_taken(n, kept, of)).collect();
            assert_eq!(taken.len() as u64, kept);
            assert!(taken.windows(2).all(|w| w[1] - w[0] <= of.div_ceil(kept)));
        }
    }
}
