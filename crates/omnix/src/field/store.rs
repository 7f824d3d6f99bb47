//! Where a field's parts lie: on the device, in a spool file of this run, or in a saved file.
//!
//! On the device every image's parts have buffers of their own, so that kernels bind them as they are and no buffer grows
//! with the number of images. From a file one image at a time goes to the device.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use omnix_io::IoError;
use omnix_io::output::field::FieldReader;
use omnix_kernels::{BufferSlice, Gpu, KernelError, readback};
use omnix_tensors::scattered;

use super::shape::{FieldShape, PARTS, Part};
use crate::error::OmnixError;

/// What a part's buffer can be used for.
const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);

/// One image's parts on the device, in the order of [`PARTS`].
pub(crate) type Resident = [BufferSlice; PARTS.len()];

/// All images' parts.
#[derive(Debug)]
pub(crate) struct Store {
    gpu: Gpu,
    shape: FieldShape,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Device(Vec<[Option<BufferSlice>; PARTS.len()]>),
    File { file: Box<Mutex<Backing>>, staged: Box<Mutex<Option<Staged>>> },
}

/// The buffers that images of a file pass through, and the image that is in them.
#[derive(Debug)]
struct Staged {
    image: usize,
    parts: Resident,
}

#[derive(Debug)]
enum Backing {
    /// Parts one after another, each with all images, f32: an unnamed file, gone with the process.
    Spool {
        file: File,
        folder: PathBuf,
    },
    Saved(Arc<FieldReader>),
}

impl Store {
    /// An empty store on the device.
    pub(crate) fn device(gpu: &Gpu, shape: FieldShape) -> Self {
        let empty = || std::array::from_fn(|_| None);
        Self { gpu: gpu.clone(), shape, place: Place::Device((0..shape.images).map(|_| empty()).collect()) }
    }

    /// An empty spool file in `folder`.
    pub(crate) fn spool(gpu: &Gpu, shape: FieldShape, folder: &Path) -> Result<Self, OmnixError> {
        let write = |source| IoError::write(folder, source);
        let file = tempfile::tempfile_in(folder).map_err(write)?;
        Ok(Self::file(gpu, shape, Backing::Spool { file, folder: folder.to_owned() }))
    }

    /// A saved field.
    pub(crate) fn saved(gpu: &Gpu, shape: FieldShape, reader: Arc<FieldReader>) -> Self {
        Self::file(gpu, shape, Backing::Saved(reader))
    }

    fn file(gpu: &Gpu, shape: FieldShape, backing: Backing) -> Self {
        let place = Place::File { file: Box::new(Mutex::new(backing)), staged: Box::new(Mutex::new(None)) };
        Self { gpu: gpu.clone(), shape, place }
    }

    /// Whether the parts are kept on the device.
    pub(crate) fn on_device(&self) -> bool {
        matches!(self.place, Place::Device(_))
    }

    /// Takes a part of an image from a buffer of the device.
    pub(crate) fn put(&mut self, image: usize, part: Part, from: &BufferSlice) -> Result<(), OmnixError> {
        let bytes = self.shape.numbers(part) as u64 * 4;
        let from = BufferSlice { size: bytes, ..from.clone() };
        match &mut self.place {
            Place::Device(images) => {
                let buffer = self.gpu.buffer(part.name(), self.shape.part_bytes(part), USAGE)?;
                let own = BufferSlice { buffer, offset: 0, size: bytes };
                copy(&self.gpu, &from, &own);
                images[image][part as usize] = Some(own);
                Ok(())
            }
            Place::File { file, .. } => {
                let numbers = readback::read::<f32>(&self.gpu, &from)?;
                let backing = file.get_mut().unwrap_or_else(PoisonError::into_inner);
                backing.write(&self.shape, image, part, &numbers)
            }
        }
    }

    /// Copies a part of an image into a buffer of the device.
    pub(crate) fn give(&self, image: usize, part: Part, to: &BufferSlice) -> Result<(), OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let from = images[image][part as usize].as_ref().ok_or_else(|| absent(part))?;
                copy(&self.gpu, from, to);
            }
            Place::File { .. } => {
                let numbers = self.numbers(image, part)?;
                self.gpu.queue.write_buffer(&to.buffer, to.offset, bytemuck::cast_slice(&numbers));
            }
        }
        Ok(())
    }

    /// One image's parts on the device: until the next call, if they come from a file.
    pub(crate) fn image(&self, image: usize) -> Result<Resident, OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let part = |part: Part| images[image][part as usize].clone().ok_or_else(|| absent(part));
                Ok([part(PARTS[0])?, part(PARTS[1])?, part(PARTS[2])?, part(PARTS[3])?, part(PARTS[4])?])
            }
            Place::File { staged, .. } => {
                let mut staged = staged.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(found) = staged.as_ref().filter(|s| s.image == image) {
                    return Ok(found.parts.clone());
                }
                let parts = match staged.take() {
                    Some(before) => before.parts,
                    None => self.buffers()?,
                };
                for (part, slice) in PARTS.into_iter().zip(&parts) {
                    let numbers = self.numbers(image, part)?;
                    self.gpu.queue.write_buffer(&slice.buffer, slice.offset, bytemuck::cast_slice(&numbers));
                    // What is written waits in staging memory until it is submitted.
                    self.gpu.queue.submit([]);
                    self.gpu.wait()?;
                }
                *staged = Some(Staged { image, parts: parts.clone() });
                Ok(parts)
            }
        }
    }

    /// A part of an image on the host.
    pub(crate) fn numbers(&self, image: usize, part: Part) -> Result<Vec<f32>, OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let slice = images[image][part as usize].as_ref().ok_or_else(|| absent(part))?;
                Ok(readback::read(&self.gpu, slice)?)
            }
            Place::File { .. } => self.backing(part)?.range(&self.shape, image, part, 0..self.shape.numbers(part)),
        }
    }

    /// Rows of listed pixels of a part that has a row for each pixel, in the order of `pixels`, from a file; little else is read.
    pub(crate) fn rows(&self, image: usize, part: Part, pixels: &[u32]) -> Result<Vec<f32>, OmnixError> {
        let width = self.shape.numbers(part) / self.shape.pixels();
        self.backing(part)?.rows(&self.shape, image, part, (width, pixels))
    }

    /// The field of an image at some target times, and then at its own time, `[levels, times + 1, cells, 9]`, from a file.
    pub(crate) fn times(&self, image: usize, times: &Range<usize>) -> Result<Vec<f32>, OmnixError> {
        let shape = &self.shape;
        let time = shape.cells() * 9;
        let mut backing = self.backing(Part::Field)?;
        let mut numbers = Vec::with_capacity(shape.levels * (times.len() + 1) * time);
        for level in 0..shape.levels {
            for times in [times.clone(), image..image + 1] {
                let from = level * shape.images * time;
                let range = from + times.start * time..from + times.end * time;
                numbers.extend(backing.range(shape, image, Part::Field, range)?);
            }
        }
        Ok(numbers)
    }

    /// The file, where it comes from one.
    fn backing(&self, part: Part) -> Result<MutexGuard<'_, Backing>, OmnixError> {
        match &self.place {
            Place::Device(_) => Err(absent(part)),
            Place::File { file, .. } => Ok(file.lock().unwrap_or_else(PoisonError::into_inner)),
        }
    }

    /// Bytes read from a saved file so far.
    pub(crate) fn bytes_read(&self) -> u64 {
        match self.backing(Part::Field).as_deref() {
            Ok(Backing::Saved(reader)) => reader.bytes_read(),
            Ok(Backing::Spool { .. }) | Err(_) => 0,
        }
    }

    fn buffers(&self) -> Result<Resident, KernelError> {
        let buffer = |part: Part| {
            let buffer = self.gpu.buffer(part.name(), self.shape.part_bytes(part), USAGE)?;
            Ok::<_, KernelError>(BufferSlice { buffer, offset: 0, size: self.shape.numbers(part) as u64 * 4 })
        };
        Ok([buffer(PARTS[0])?, buffer(PARTS[1])?, buffer(PARTS[2])?, buffer(PARTS[3])?, buffer(PARTS[4])?])
    }
}

impl Backing {
    fn write(&mut self, shape: &FieldShape, image: usize, part: Part, numbers: &[f32]) -> Result<(), OmnixError> {
        let Self::Spool { file, folder } = self else { return Err(absent(part)) };
        let at = SeekFrom::Start(place(shape, image, part));
        let written = file.seek(at).and_then(|_| file.write_all(bytemuck::cast_slice(numbers)));
        Ok(written.map_err(|source| IoError::write(&*folder, source))?)
    }

    /// Numbers of a part of an image.
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

    /// Rows of `width` numbers of a part of an image.
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
}

/// Bytes of a spool file from `at` on.
fn spooled(file: &mut File, folder: &Path, at: u64, bytes: &mut [u8]) -> Result<(), OmnixError> {
    let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes));
    Ok(read.map_err(|source| IoError::Read { path: folder.to_owned(), source })?)
}

/// First byte of a part of an image in a spool file.
fn place(shape: &FieldShape, image: usize, part: Part) -> u64 {
    let before: usize = PARTS.iter().take(part as usize).map(|p| shape.images * shape.numbers(*p)).sum();
    4 * (before + image * shape.numbers(part)) as u64
}

fn absent(part: Part) -> OmnixError {
    OmnixError::Request { reason: format!("BUG: the field has no {} of this image", part.name()) }
}

/// Copies all of a slice into another, and submits that.
pub(crate) fn copy(gpu: &Gpu, from: &BufferSlice, to: &BufferSlice) {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(&from.buffer, from.offset, &to.buffer, to.offset, from.size);
    gpu.queue.submit([encoder.finish()]);
}
