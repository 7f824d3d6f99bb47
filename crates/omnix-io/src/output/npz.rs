//! `npz` and `mini_npz`: Depth Anything 3's result archives (`da3.md` section 15).
//!
//! Arrays over all S images: `image` u8 [S,H,W,3] (npz only), `depth` f32 [S,H,W] (rounded to 6 decimals, mini 8), `conf` f32
//! [S,H,W] (2 decimals), `extrinsics` f32 [S,3,4] world-to-camera, `intrinsics` f32 [S,3,3], and `sky` bool [S,H,W], which upstream
//! leaves out; absent ones are left out. Each array
//! is spooled to an unnamed file as images come and packed at the end, because its header states S. Archives above 4 GiB are
//! zip64; arrays above 1 GiB are stored uncompressed, since packing them would take minutes (numpy reads both).
//! Format of an array: NPY version 1.0, C order, little endian.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use super::{
    atomic::Spool,
    format::{FileKind, Format},
    frame::{FrameResult, RunSummary, Sink},
    npy,
};
use crate::IoError;

/// `npz`.
pub(super) const FULL: Format = Format {
    name: "npz",
    by_default: true,
    files: &[FileKind::one(
        "exports/npz/results.npz",
        "image u8 [S,H,W,3], depth f32 [S,H,W] (6 decimals), conf f32 [S,H,W] (2 decimals), extrinsics f32 [S,3,4], intrinsics f32 [S,3,3], sky bool [S,H,W]; without those that the network does not make",
    )],
    disk: |size| size.all().saturating_mul(12),
    frames: Some(|dir, _| Ok(Box::new(NpzSink::new(dir, Layout::Full)))),
    ..Format::NONE
};

/// `mini_npz`.
pub(super) const MINI: Format = Format {
    name: "mini_npz",
    files: &[FileKind::one(
        "exports/mini_npz/results.npz",
        "depth f32 [S,H,W] (8 decimals), conf f32 [S,H,W] (2 decimals), extrinsics f32 [S,3,4], intrinsics f32 [S,3,3], sky bool [S,H,W]; without those that the network does not make",
    )],
    disk: |size| size.all().saturating_mul(9),
    frames: Some(|dir, _| Ok(Box::new(NpzSink::new(dir, Layout::Mini)))),
    ..Format::NONE
};

/// Which of the two archives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Full,
    Mini,
}

/// One array as it grows.
struct Column {
    name: &'static str,
    dtype: &'static str,
    shape: Vec<usize>,
    /// Bytes of one image's part.
    image_bytes: u64,
    spool: Spool,
}

struct NpzSink {
    dir: PathBuf,
    path: PathBuf,
    layout: Layout,
    images: usize,
    columns: Vec<Column>,
}

impl NpzSink {
    fn new(dir: &Path, layout: Layout) -> Self {
        let path = dir.join(layout.format().files[0].name);
        Self { dir: dir.to_owned(), path, layout, images: 0, columns: Vec::new() }
    }

    /// Appends one image's part; the first image decides which arrays exist and their shape.
    fn append(&mut self, frame: &FrameResult<'_>, part: Part<'_>) -> Result<(), IoError> {
        if self.images == 0 {
            let spool = Spool::new(&self.dir, self.path.clone())?;
            let shape = part.shape.clone();
            self.columns.push(Column {
                name: part.name,
                dtype: part.dtype,
                shape,
                image_bytes: part.bytes.len() as u64,
                spool,
            });
        }
        let wrong = |expected: &[usize]| IoError::WrongSize {
            export: self.layout.format().name,
            what: part.name,
            index: frame.index,
            expected: expected.iter().product(),
            found: part.shape.iter().product(),
        };
        match self.columns.iter_mut().find(|c| c.name == part.name) {
            Some(column) if column.shape == part.shape => column.spool.put(part.bytes),
            Some(column) => Err(wrong(&column.shape)),
            None => Err(wrong(&[0])),
        }
    }
}

/// One image's share of an array.
struct Part<'a> {
    name: &'static str,
    dtype: &'static str,
    shape: Vec<usize>,
    bytes: &'a [u8],
}

impl Layout {
    fn format(self) -> &'static Format {
        match self {
            Self::Full => &FULL,
            Self::Mini => &MINI,
        }
    }
}

impl Sink for NpzSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        let export = self.layout.format().name;
        frame.check(export)?;
        let (w, h) = (frame.width as usize, frame.height as usize);
        let decimals = if self.layout == Layout::Full { 1e6 } else { 1e8 };
        let depth = little_endian(frame.depth.iter().map(|&d| rounded(d, decimals)));
        let conf = frame.confidence.map(|c| little_endian(c.iter().map(|&v| rounded(v, 100.0))));
        let extrinsics = frame.extrinsics.map(|e| little_endian(e.into_iter().flatten()));
        let intrinsics = frame.intrinsics.map(|k| little_endian(k.into_iter().flatten()));
        let sky: Option<Vec<u8>> = frame.sky.map(|sky| sky.iter().map(|s| u8::from(*s)).collect());
        let f32s = |name, shape, bytes| Part { name, dtype: "<f4", shape, bytes };
        let mut parts = Vec::with_capacity(6);
        if self.layout == Layout::Full {
            parts.push(Part { name: "image", dtype: "|u1", shape: vec![h, w, 3], bytes: frame.rgb });
        }
        parts.push(f32s("depth", vec![h, w], depth.as_slice()));
        parts.extend(conf.as_deref().map(|bytes| f32s("conf", vec![h, w], bytes)));
        parts.extend(extrinsics.as_deref().map(|bytes| f32s("extrinsics", vec![3, 4], bytes)));
        parts.extend(intrinsics.as_deref().map(|bytes| f32s("intrinsics", vec![3, 3], bytes)));
        parts.extend(sky.as_deref().map(|bytes| Part { name: "sky", dtype: "|b1", shape: vec![h, w], bytes }));
        if let Some(column) = self.columns.iter().find(|c| parts.iter().all(|p| p.name != c.name)) {
            return Err(IoError::MissingField { export, missing: column.name, index: frame.index });
        }
        for part in parts {
            self.append(frame, part)?;
        }
        self.images += 1;
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        if self.images == 0 {
            return Ok(Vec::new());
        }
        let mut archive = npy::Archive::create(self.path)?;
        for column in self.columns {
            let large = column.spool.len() > 1 << 30;
            let pack = if large { npy::Pack::Stored } else { npy::Pack::Deflated };
            let shape: Vec<usize> = [self.images].into_iter().chain(column.shape).collect();
            // A write that failed in the middle of an image may have left more than the finished images.
            let whole = self.images as u64 * column.image_bytes;
            let mut body = column.spool.into_reader()?.take(whole);
            archive.add(column.name, &npy::header(column.dtype, &shape), &mut body, pack, large)?;
        }
        Ok(vec![archive.finish()?])
    }
}

/// numpy's `round`: scale, round half to even, scale back, all in f32. Values beyond f32's range when scaled stay.
fn rounded(value: f32, scale: f32) -> f32 {
    let scaled = value * scale;
    if scaled.is_finite() { scaled.round_ties_even() / scale } else { value }
}

fn little_endian(values: impl Iterator<Item = f32>) -> Vec<u8> {
    values.flat_map(f32::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_as_numpy() {
        assert_eq!(rounded(1.234_567_8, 1e6), 1.234_568);
        assert_eq!(rounded(2.345, 100.0), 2.34);
        assert_eq!(rounded(f32::MAX, 1e6), f32::MAX);
        assert!(rounded(f32::NAN, 1e6).is_nan());
    }
}
