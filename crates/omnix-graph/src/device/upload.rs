//! Parameters on their way to the device: read, packed and written in pieces, the tensors of a piece side by side.
//!
//! A software device takes the process's own memory: it is written in place, and beside it only the tensors at hand are in
//! memory. Other devices copy from staging buffers: a piece is packed while the one before is copied.

use std::ops::ControlFlow;

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{BufferSlice, Gpu};
use rayon::prelude::*;

use super::source::ParameterSource;
use crate::error::GraphError;
use crate::graph::WeightKey;

/// Bytes of a buffer: more than a device's allocator would put into one block with others, so that it takes what was planned. (The
/// weights of a stretch of [`crate::Streamed`] are less; wgpu's blocks are small, since memory was asked to be.)
const BUFFER: u64 = 256 << 20;
/// Bytes of a piece; a larger tensor is a piece of its own.
const PIECE: u64 = 16 << 20;

/// Is called with the number of bytes of each piece once it is written; may stop the upload.
pub(crate) type Written<'a> = &'a mut dyn FnMut(u64) -> ControlFlow<()>;

/// Uploads `keys`; gives where each is, and the bytes of the buffers.
///
/// # Errors
/// When a tensor cannot be read or stored, memory runs out, or `written` broke off ([`GraphError::Interrupted`]).
pub(crate) async fn upload(
    gpu: &Gpu,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    written: Written<'_>,
) -> Result<(Vec<BufferSlice>, u64), GraphError> {
    let (tail, windows) = if gpu.caps.weight_windows() {
        (UNIFORM_WINDOW, wgpu::BufferUsages::UNIFORM)
    } else {
        (0, wgpu::BufferUsages::empty())
    };
    let (mut slices, mut total) = (Vec::with_capacity(keys.len()), 0);
    for keys in split(keys, gpu.caps.max_buffer.min(BUFFER) - tail) {
        let (size, usage) = (bytes(keys) + tail, wgpu::BufferUsages::STORAGE | windows);
        let buffer = if gpu.imports() {
            let mut memory = gpu.host_memory("weights", size)?;
            in_place(&mut memory, source, keys, written)?;
            gpu.import("weights", memory, usage)?
        } else {
            let buffer = gpu.buffer("weights", size, usage | wgpu::BufferUsages::COPY_DST)?;
            staged(gpu, &buffer, source, keys, written).await?;
            buffer
        };
        slices.extend(keys.iter().scan(0, |offset, key| {
            let slice = BufferSlice { buffer: buffer.clone(), offset: *offset, size: key.bytes() };
            *offset += slice.size;
            Some(slice)
        }));
        total += size;
    }
    Ok((slices, total))
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

/// Fills the memory of a buffer to be.
fn in_place(
    mut room: &mut [u8],
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    written: Written<'_>,
) -> Result<(), GraphError> {
    for piece in split(keys, PIECE) {
        let (place, rest) = room.split_at_mut(bytes(piece) as usize);
        fill(place, source, piece)?;
        if written(bytes(piece)).is_break() {
            return Err(GraphError::Interrupted);
        }
        room = rest;
    }
    Ok(())
}

/// Writes a buffer through staging memory. Two pieces are in memory at a time, and the packed third. The last may still be on its way
/// when this returns: what is submitted next comes after it, and a device that has work is not waited for.
async fn staged(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    written: Written<'_>,
) -> Result<(), GraphError> {
    let mut offset = 0;
    let mut copying: Option<wgpu::SubmissionIndex> = None;
    for piece in split(keys, PIECE) {
        let mut packed = vec![0; bytes(piece) as usize];
        fill(&mut packed, source, piece)?;
        // Written at once: parts of a view cannot be sent to other threads (wgpu 30).
        gpu.staging(buffer, offset, bytes(piece))?.copy_from_slice(&packed);
        drop(packed);
        let copy = gpu.queue.submit([]);
        if let Some(before) = copying.replace(copy) {
            gpu.wait_for_async(before).await?;
        }
        if written(bytes(piece)).is_break() {
            return Err(GraphError::Interrupted);
        }
        offset += bytes(piece);
    }
    Ok(())
}

/// Reads and packs `keys` on all processors, one after another into `room`. Of several that fail the first is reported.
fn fill(mut room: &mut [u8], source: &dyn ParameterSource, keys: &[&WeightKey]) -> Result<(), GraphError> {
    let mut places = Vec::with_capacity(keys.len());
    for key in keys {
        let (place, after) = room.split_at_mut(key.bytes() as usize);
        places.push((key, place));
        room = after;
    }
    let write = |(key, place): (&&WeightKey, &mut [u8])| -> Result<(), GraphError> {
        let name = &key.parameter.name;
        let numbers = source.read(name).map_err(|source| GraphError::Parameter { name: name.to_string(), source })?;
        let packed = key.pack(&numbers, place);
        drop(numbers);
        source.release(name);
        packed
    };
    places.into_par_iter().find_map_first(|place| write(place).err()).map_or(Ok(()), Err)
}
