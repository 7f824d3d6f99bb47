//! Where a field's parts lie: on the device, in a spool file of this run, or in a saved file.
//!
//! On the device every image's parts have buffers of their own, so that kernels bind them as they are and no buffer grows
//! with the number of images. From a file one image at a time goes to the device.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use omnix_kernels::readback::read_async;
use omnix_kernels::{BufferSlice, Gpu, KernelError};

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
    #[cfg_attr(not(feature = "io"), expect(dead_code, reason = "made where there are files"))]
    File {
        file: Mutex<Box<dyn Backing>>,
        staged: Box<Mutex<Option<Staged>>>,
    },
}

/// The buffers that images of a file pass through, and the image that is in them.
#[derive(Debug)]
struct Staged {
    image: usize,
    parts: Resident,
}

/// Where the parts lie that are not on the device: one after another, each with all images.
pub(super) trait Backing: Send + std::fmt::Debug {
    /// Writes a part of an image.
    fn write(&mut self, shape: &FieldShape, image: usize, part: Part, numbers: &[f32]) -> Result<(), OmnixError>;

    /// Numbers of a part of an image.
    fn range(
        &mut self,
        shape: &FieldShape,
        image: usize,
        part: Part,
        numbers: Range<usize>,
    ) -> Result<Vec<f32>, OmnixError>;

    /// Rows of `width` numbers of a part of an image.
    fn rows(
        &mut self,
        shape: &FieldShape,
        image: usize,
        part: Part,
        of: (usize, &[u32]),
    ) -> Result<Vec<f32>, OmnixError>;

    /// Bytes read so far from a file that outlives the run.
    fn bytes_read(&self) -> u64;
}

impl Store {
    /// An empty store on the device.
    pub(crate) fn device(gpu: &Gpu, shape: FieldShape) -> Self {
        let empty = || std::array::from_fn(|_| None);
        Self { gpu: gpu.clone(), shape, place: Place::Device((0..shape.images).map(|_| empty()).collect()) }
    }

    /// A store beside the device.
    #[cfg(feature = "io")]
    pub(super) fn beside(gpu: &Gpu, shape: FieldShape, backing: impl Backing + 'static) -> Self {
        let place = Place::File { file: Mutex::new(Box::new(backing)), staged: Box::new(Mutex::new(None)) };
        Self { gpu: gpu.clone(), shape, place }
    }

    /// Whether the parts are kept on the device.
    pub(crate) fn on_device(&self) -> bool {
        matches!(self.place, Place::Device(_))
    }

    /// Takes a part of an image from a buffer of the device.
    pub(crate) async fn put(&mut self, image: usize, part: Part, from: &BufferSlice) -> Result<(), OmnixError> {
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
                let numbers = read_async::<f32>(&self.gpu, &from).await?;
                let backing = file.get_mut().unwrap_or_else(PoisonError::into_inner);
                backing.write(&self.shape, image, part, &numbers)
            }
        }
    }

    /// Puts other numbers in the place of those of a part that is there.
    pub(crate) fn replace(&mut self, image: usize, part: Part, numbers: &[f32]) -> Result<(), OmnixError> {
        match &mut self.place {
            Place::Device(images) => {
                let to = images[image][part as usize].as_ref().ok_or_else(|| absent(part))?;
                self.gpu.queue.write_buffer(&to.buffer, to.offset, bytemuck::cast_slice(numbers));
                // What is written waits in staging memory until it is submitted.
                self.gpu.queue.submit([]);
                Ok(())
            }
            Place::File { file, .. } => {
                file.get_mut().unwrap_or_else(PoisonError::into_inner).write(&self.shape, image, part, numbers)
            }
        }
    }

    /// Copies a part of an image into a buffer of the device.
    pub(crate) async fn give(&self, image: usize, part: Part, to: &BufferSlice) -> Result<(), OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let from = images[image][part as usize].as_ref().ok_or_else(|| absent(part))?;
                copy(&self.gpu, from, to);
            }
            Place::File { .. } => {
                let numbers = self.numbers(image, part).await?;
                self.gpu.queue.write_buffer(&to.buffer, to.offset, bytemuck::cast_slice(&numbers));
            }
        }
        Ok(())
    }

    /// One image's parts on the device. If they come from a file, the caller has the buffers that they pass through until it gives them back
    /// with [`Store::release`]; whoever asks meanwhile gets others.
    pub(crate) async fn image(&self, image: usize) -> Result<Resident, OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let part = |part: Part| images[image][part as usize].clone().ok_or_else(|| absent(part));
                Ok([part(PARTS[0])?, part(PARTS[1])?, part(PARTS[2])?, part(PARTS[3])?, part(PARTS[4])?])
            }
            Place::File { staged, .. } => {
                let before = staged.lock().unwrap_or_else(PoisonError::into_inner).take();
                let parts = match before {
                    Some(found) if found.image == image => return Ok(found.parts),
                    Some(before) => before.parts,
                    None => self.buffers()?,
                };
                for (part, slice) in PARTS.into_iter().zip(&parts) {
                    let numbers = self.numbers(image, part).await?;
                    self.gpu.queue.write_buffer(&slice.buffer, slice.offset, bytemuck::cast_slice(&numbers));
                    // What is written waits in staging memory until it is submitted.
                    self.gpu.queue.submit([]);
                    self.gpu.wait_async().await?;
                }
                Ok(parts)
            }
        }
    }

    /// Takes back the buffers of [`Store::image`], with that image in them, for the next call.
    pub(crate) fn release(&self, image: usize, parts: Resident) {
        if let Place::File { staged, .. } = &self.place {
            *staged.lock().unwrap_or_else(PoisonError::into_inner) = Some(Staged { image, parts });
        }
    }

    /// A part of an image on the host.
    pub(crate) async fn numbers(&self, image: usize, part: Part) -> Result<Vec<f32>, OmnixError> {
        match &self.place {
            Place::Device(images) => {
                let slice = images[image][part as usize].as_ref().ok_or_else(|| absent(part))?;
                Ok(read_async(&self.gpu, slice).await?)
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
    fn backing(&self, part: Part) -> Result<MutexGuard<'_, Box<dyn Backing>>, OmnixError> {
        match &self.place {
            Place::Device(_) => Err(absent(part)),
            Place::File { file, .. } => Ok(file.lock().unwrap_or_else(PoisonError::into_inner)),
        }
    }

    /// Bytes read from a saved file so far.
    pub(crate) fn bytes_read(&self) -> u64 {
        self.backing(Part::Field).map_or(0, |backing| backing.bytes_read())
    }

    fn buffers(&self) -> Result<Resident, KernelError> {
        let buffer = |part: Part| {
            let buffer = self.gpu.buffer(part.name(), self.shape.part_bytes(part), USAGE)?;
            Ok::<_, KernelError>(BufferSlice { buffer, offset: 0, size: self.shape.numbers(part) as u64 * 4 })
        };
        Ok([buffer(PARTS[0])?, buffer(PARTS[1])?, buffer(PARTS[2])?, buffer(PARTS[3])?, buffer(PARTS[4])?])
    }
}

pub(super) fn absent(part: Part) -> OmnixError {
    OmnixError::Request { reason: format!("BUG: the field has no {} of this image", part.name()) }
}

/// Copies all of a slice into another, and submits that.
pub(crate) fn copy(gpu: &Gpu, from: &BufferSlice, to: &BufferSlice) {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(&from.buffer, from.offset, &to.buffer, to.offset, from.size);
    gpu.queue.submit([encoder.finish()]);
}
