//! Parts of a field that lie in a file: a spool of this run, or a saved field.

use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use omnix_io::IoError;
use omnix_io::output::field::FieldReader;
use omnix_kernels::Gpu;
use omnix_tensors::scattered;

use super::maps::SavedMaps;
use super::shape::{FieldShape, PARTS, Part};
use super::store::{Backing, Store, absent};
use crate::error::OmnixError;

#[derive(Debug)]
enum File {
    /// Parts one after another, each with all images, f32: an unnamed file, gone with the process.
    Spool {
        file: std::fs::File,
        folder: PathBuf,
    },
    Saved(Arc<FieldReader>),
}

impl Store {
    /// An empty spool file in `folder`.
    pub(crate) fn spool(gpu: &Gpu, shape: FieldShape, folder: &Path) -> Result<Self, OmnixError> {
        let write = |source| IoError::write(folder, source);
        let file = tempfile::tempfile_in(folder).map_err(write)?;
        Ok(Self::beside(gpu, shape, File::Spool { file, folder: folder.to_owned() }))
    }

    /// A saved field.
    pub(crate) fn saved(gpu: &Gpu, shape: FieldShape, reader: Arc<FieldReader>) -> Self {
        Self::beside(gpu, shape, File::Saved(reader))
    }
}

impl Backing for File {
    fn write(&mut self, shape: &FieldShape, image: usize, part: Part, numbers: &[f32]) -> Result<(), OmnixError> {
        let Self::Spool { file, folder } = self else { return Err(absent(part)) };
        let at = SeekFrom::Start(place(shape, image, part));
        let written = file.seek(at).and_then(|_| file.write_all(bytemuck::cast_slice(numbers)));
        Ok(written.map_err(|source| IoError::write(&*folder, source))?)
    }

    fn range(
        &mut self,
        shape: &FieldShape,
        image: usize,
        part: Part,
        numbers: Range<usize>,
    ) -> Result<Vec<f32>, OmnixError> {
        let before = image * shape.numbers(part);
        match self {
            Self::Spool { file, folder } => {
                let mut read = vec![0.0f32; numbers.len()];
                let at = place(shape, image, part) + 4 * numbers.start as u64;
                spooled(file, folder, at, bytemuck::cast_slice_mut(&mut read))?;
                Ok(read)
            }
            Self::Saved(reader) => Ok(reader.read(part.name(), before + numbers.start..before + numbers.end)?),
        }
    }

    fn rows(
        &mut self,
        shape: &FieldShape,
        image: usize,
        part: Part,
        (width, rows): (usize, &[u32]),
    ) -> Result<Vec<f32>, OmnixError> {
        match self {
            Self::Spool { file, folder } => {
                let start = place(shape, image, part);
                let bytes = scattered(rows, 4 * width, &mut |range| {
                    let mut bytes = vec![0; range.len()];
                    spooled(file, folder, start + range.start as u64, &mut bytes).map(|()| bytes)
                })?;
                Ok(bytes.as_chunks().0.iter().map(|b| f32::from_ne_bytes(*b)).collect())
            }
            Self::Saved(reader) => Ok(reader.rows(part.name(), image * shape.numbers(part), width, rows)?),
        }
    }

    fn bytes_read(&self) -> u64 {
        match self {
            Self::Saved(reader) => reader.bytes_read(),
            Self::Spool { .. } => 0,
        }
    }
}

/// Bytes of a spool file from `at` on.
fn spooled(file: &mut std::fs::File, folder: &Path, at: u64, bytes: &mut [u8]) -> Result<(), OmnixError> {
    let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes));
    Ok(read.map_err(|source| IoError::Read { path: folder.to_owned(), source })?)
}

/// First byte of a part of an image in a spool file.
fn place(shape: &FieldShape, image: usize, part: Part) -> u64 {
    let before: usize = PARTS.iter().take(part as usize).map(|p| shape.images * shape.numbers(*p)).sum();
    4 * (before + image * shape.numbers(part)) as u64
}

/// The maps of a saved field.
#[derive(Debug)]
pub(super) struct MapsFile {
    pub(super) file: Arc<FieldReader>,
    pub(super) pictures: bool,
}

impl SavedMaps for MapsFile {
    fn range(&self, name: &str, pixels: Range<usize>) -> Result<Vec<f32>, OmnixError> {
        Ok(self.file.read(name, pixels)?)
    }

    fn rows(&self, name: &str, first: usize, pixels: &[u32]) -> Result<Vec<f32>, OmnixError> {
        Ok(self.file.rows(name, first, 1, pixels)?)
    }

    fn have_pictures(&self) -> bool {
        self.pictures
    }

    fn colours(&self, pixels: Range<usize>) -> Result<Vec<u32>, OmnixError> {
        Ok(self.file.read_u32("pictures", pixels)?)
    }

    fn colour_rows(&self, first: usize, pixels: &[u32]) -> Result<Vec<u32>, OmnixError> {
        Ok(self.file.rows_u32("pictures", first, 1, pixels)?)
    }
}
