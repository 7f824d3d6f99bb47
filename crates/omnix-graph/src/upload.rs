//! Parameters on their way to the device: read, packed and written in pieces, the tensors of a piece side by side.
//!
//! The memory of a software device is the process's own. Its buffers are mapped and written in place: beside them only the
//! tensors at hand are in memory. Other devices copy from staging buffers, of which one is filled while another is copied.

use std::ops::{ControlFlow, Range};
use std::sync::{Mutex, PoisonError};

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{Gpu, KernelError};
use rayon::prelude::*;

use crate::error::GraphError;
use crate::weights::{ParameterSource, WeightKey};

/// Bytes of a buffer: more than a device's allocator would put into one block with others, so that it takes what was planned.
const BUFFER: u64 = 256 << 20;
/// Bytes of a piece; a larger tensor is a piece of its own.
const PIECE: u64 = 16 << 20;

/// Hears of each piece when it is written: its keys, one after another from an offset in a buffer. May break off.
pub(crate) type Finished<'a> = &'a mut dyn FnMut(&[&WeightKey], &wgpu::Buffer, u64) -> ControlFlow<()>;

/// Uploads `keys` in order; gives the bytes of the buffers.
///
/// # Errors
/// When a tensor cannot be read, memory runs out, or `finished` broke off ([`GraphError::Interrupted`]).
pub(crate) fn upload(
    gpu: &Gpu,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    finished: Finished<'_>,
) -> Result<u64, GraphError> {
    let (tail, windows) = if gpu.caps.weight_windows() {
        (UNIFORM_WINDOW, wgpu::BufferUsages::UNIFORM)
    } else {
        (0, wgpu::BufferUsages::empty())
    };
    let mut total = 0;
    for keys in split(keys, gpu.caps.max_buffer.min(BUFFER) - tail) {
        let (size, usage) = (bytes(keys) + tail, wgpu::BufferUsages::STORAGE | windows);
        if gpu.maps_buffers() {
            in_place(&gpu.buffer_mapped("weights", size, usage)?, source, keys, finished)?;
        } else {
            staged(gpu, &gpu.buffer("weights", size, usage | wgpu::BufferUsages::COPY_DST)?, source, keys, finished)?;
        }
        total += size;
    }
    Ok(total)
}

fn bytes(keys: &[&WeightKey]) -> u64 {
    keys.iter().map(|key| key.bytes()).sum()
}

/// Neighbours of up to `limit` bytes together, or one key.
fn split<'a>(mut keys: &'a [&'a WeightKey], limit: u64) -> Vec<&'a [&'a WeightKey]> {
    let mut parts = Vec::new();
    while !keys.is_empty() {
        let mut bytes = 0;
        let fit = keys.iter().take_while(|key| {
            bytes += key.bytes();
            bytes <= limit
        });
        let (part, rest) = keys.split_at(fit.count().max(1));
        parts.push(part);
        keys = rest;
    }
    parts
}

/// Writes a mapped buffer and gives it to the device.
fn in_place(
    buffer: &wgpu::Buffer,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    finished: Finished<'_>,
) -> Result<(), GraphError> {
    let refused = |error: wgpu::MapRangeError| KernelError::DeviceLost { message: error.to_string() };
    let mut view = buffer.get_mapped_range_mut(..).map_err(refused)?;
    let mut offset = 0;
    for piece in split(keys, PIECE) {
        fill(&mut view, offset as usize, source, piece)?;
        if finished(piece, buffer, offset).is_break() {
            return Err(GraphError::Interrupted);
        }
        offset += bytes(piece);
    }
    drop(view);
    buffer.unmap();
    Ok(())
}

/// Writes a buffer through staging memory, of which there are two pieces at a time.
fn staged(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    finished: Finished<'_>,
) -> Result<(), GraphError> {
    let mut offset = 0;
    let mut copying: Option<wgpu::SubmissionIndex> = None;
    for piece in split(keys, PIECE) {
        let mut view = gpu.staging(buffer, offset, bytes(piece))?;
        let filled = fill(&mut view, 0, source, piece);
        // Dropping it asks for the copy, also of a piece that failed: what is submitted frees its memory.
        drop(view);
        let copy = gpu.queue.submit([]);
        filled?;
        if let Some(before) = copying.replace(copy) {
            gpu.wait_for(before)?;
        }
        if finished(piece, buffer, offset).is_break() {
            return Err(GraphError::Interrupted);
        }
        offset += bytes(piece);
    }
    copying.map_or(Ok(()), |copy| Ok(gpu.wait_for(copy)?))
}

/// Memory to write to.
trait Room: Send {
    fn part(&mut self, range: Range<usize>) -> wgpu::WriteOnly<'_, [u8]>;
}

impl Room for wgpu::BufferViewMut {
    fn part(&mut self, range: Range<usize>) -> wgpu::WriteOnly<'_, [u8]> {
        self.slice(range)
    }
}

impl Room for wgpu::QueueWriteBufferView {
    fn part(&mut self, range: Range<usize>) -> wgpu::WriteOnly<'_, [u8]> {
        self.slice(range)
    }
}

/// Reads and packs `keys` on all processors, to `start` and what follows. Of several that fail the first is reported.
fn fill(
    room: &mut dyn Room,
    start: usize,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
) -> Result<(), GraphError> {
    let ends = keys.iter().scan(start, |end, key| {
        *end += key.bytes() as usize;
        Some(*end)
    });
    let places: Vec<_> = keys.iter().zip(ends).collect();
    // A part of a view cannot be sent to another thread (wgpu 30), so that one at a time copies what it has packed.
    let room = Mutex::new(room);
    let write = |(key, end): (&&WeightKey, usize)| -> Result<(), GraphError> {
        let name = &key.parameter.name;
        let numbers = source.read(name).map_err(|source| GraphError::Parameter { name: name.to_string(), source })?;
        let packed = key.pack(&numbers);
        drop(numbers);
        source.release(name);
        let mut room = room.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut to, mut padding) = room.part(end - key.bytes() as usize..end).split_at(packed.len());
        to.copy_from_slice(&packed);
        padding.fill(0);
        Ok(())
    };
    places.into_par_iter().find_map_first(|place| write(place).err()).map_or(Ok(()), Err)
}
