//! `features`: what the encoder makes of the patches after chosen blocks, `exports/features/features.npz`: for each block N that was asked for
//! an array `block_N`, f32 [S, H/14, W/14, C], normalised as the network's own heads get it. Images are in the order of the run. Each
//! array is spooled to an unnamed file, because its header states S.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::{
    atomic::Spool,
    format::{FileKind, Format},
    frame::{FrameResult, RunSummary, Sink},
    npy,
};
use crate::IoError;

const NAME: &str = "exports/features/features.npz";

pub(super) const FORMAT: Format = Format {
    name: "features",
    needs_features: true,
    files: &[FileKind::one(
        NAME,
        "block_N f32 [S,H/14,W/14,C]: the encoder's patch tokens after block N, normalised, in the order of the images",
    )],
    disk: |size| size.feature_bytes,
    frames: Some(|dir, _| Ok(Box::new(FeatureSink { dir: dir.to_owned(), images: 0, columns: Vec::new() }))),
    ..Format::NONE
};

/// The features of one block as they grow.
struct Column {
    block: usize,
    /// Patch rows, patch columns, channels.
    shape: [usize; 3],
    spool: Spool,
}

struct FeatureSink {
    dir: PathBuf,
    images: usize,
    columns: Vec<Column>,
}

impl FeatureSink {
    fn path(dir: &Path) -> PathBuf {
        dir.join(NAME)
    }
}

impl Sink for FeatureSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        let export = FORMAT.name;
        frame.check(export)?;
        if self.images == 0 {
            for map in frame.features {
                let spool = Spool::new(&self.dir, Self::path(&self.dir))?;
                let [rows, columns] = map.grid;
                let shape = [rows, columns, map.values.len() / (rows * columns).max(1)];
                self.columns.push(Column { block: map.block, shape, spool });
            }
        }
        if frame.features.is_empty() {
            return Err(IoError::MissingField { export, missing: "features", index: frame.index });
        }
        for column in &mut self.columns {
            let expected = column.shape.iter().product();
            let found = frame.features.iter().find(|map| map.block == column.block).map_or(&[][..], |map| map.values);
            if found.len() != expected {
                let (what, index, found) = ("features", frame.index, found.len());
                return Err(IoError::WrongSize { export, what, index, expected, found });
            }
            for piece in found.chunks(1 << 14) {
                column.spool.put(&piece.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
            }
        }
        self.images += 1;
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        if self.images == 0 {
            return Ok(Vec::new());
        }
        let mut archive = npy::Archive::create(Self::path(&self.dir))?;
        for Column { block, shape, spool } in self.columns {
            let large = spool.len() > 1 << 30;
            let of_images = (self.images * shape.iter().product::<usize>() * size_of::<f32>()) as u64;
            let shape: Vec<usize> = [self.images].into_iter().chain(shape).collect();
            // A write that failed in the middle of an image may have left more than the finished images.
            let mut body = spool.into_reader()?.take(of_images);
            let name = format!("block_{block}");
            archive.add(&name, &npy::header("<f4", &shape), &mut body, npy::Pack::Stored, large)?;
        }
        Ok(vec![archive.finish()?])
    }
}
