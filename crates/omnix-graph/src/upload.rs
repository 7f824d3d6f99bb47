//! Parameters on their way to the device: read, packed and written in groups, the tensors of a group side by side, a buffer a group.
//!
//! The memory of a software device is the process's own. Its buffers are mapped and written in place, so that no weight is in
//! memory twice; while one group is packed, the next group's buffer is made (wgpu fills it with zeros, and the system finds
//! its pages). Other devices copy from staging buffers: one is filled while the one before is copied.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{Gpu, KernelError};
use rayon::prelude::*;

use crate::error::GraphError;
use crate::weights::{ParameterSource, WeightKey};

/// Bytes of a group; a larger tensor is a group of its own.
const GROUP: u64 = 16 << 20;

/// Uploads `keys` in order. `finished` hears each group, one key after another from the start of a buffer, and may break off.
///
/// # Errors
/// When a tensor cannot be read, memory runs out, or `finished` broke off ([`GraphError::Interrupted`]).
pub(crate) fn upload(
    gpu: &Gpu,
    source: &dyn ParameterSource,
    keys: &[&WeightKey],
    finished: &mut dyn FnMut(&[&WeightKey], &wgpu::Buffer) -> ControlFlow<()>,
) -> Result<(), GraphError> {
    let groups = groups(keys, GROUP.min(gpu.caps.max_buffer));
    let mut next = groups.first().map(|group| Target::new(gpu, group)).transpose()?;
    let mut copying = None;
    for (i, group) in groups.iter().enumerate() {
        let Some(mut target) = next.take() else { break };
        let (filled, made) = rayon::join(
            || target.fill(source, group),
            || groups.get(i + 1).map(|group| Target::new(gpu, group)).transpose(),
        );
        filled?;
        next = made?;
        let buffer = target.finish(gpu, &mut copying)?;
        if finished(group, &buffer).is_break() {
            return Err(GraphError::Interrupted);
        }
    }
    copying.map_or(Ok(()), |copy| Ok(gpu.wait_for(copy)?))
}

/// Neighbours that share a buffer: up to `limit` bytes, or one key.
fn groups<'a>(mut keys: &'a [&'a WeightKey], limit: u64) -> Vec<&'a [&'a WeightKey]> {
    let mut groups = Vec::new();
    while !keys.is_empty() {
        let mut bytes = 0;
        let fit = keys.iter().take_while(|key| {
            bytes += key.bytes();
            bytes <= limit
        });
        let (group, rest) = keys.split_at(fit.count().max(1));
        groups.push(group);
        keys = rest;
    }
    groups
}

/// A group's buffer, and where its bytes are written.
struct Target {
    buffer: wgpu::Buffer,
    room: Room,
}

enum Room {
    /// The buffer itself.
    Mapped(wgpu::BufferViewMut),
    /// What the queue copies to the buffer.
    Staged(wgpu::QueueWriteBufferView),
}

impl Target {
    fn new(gpu: &Gpu, keys: &[&WeightKey]) -> Result<Self, GraphError> {
        let bytes: u64 = keys.iter().map(|key| key.bytes()).sum();
        let windows = gpu.caps.weight_windows();
        let tail = if windows { UNIFORM_WINDOW } else { 0 };
        let usage = wgpu::BufferUsages::STORAGE
            | if windows { wgpu::BufferUsages::UNIFORM } else { wgpu::BufferUsages::empty() };
        let refused = || KernelError::OutOfMemory { what: "weights".to_owned(), bytes };
        if gpu.maps_buffers() {
            let buffer = gpu.buffer_mapped("weights", bytes + tail, usage)?;
            let room = Room::Mapped(buffer.get_mapped_range_mut(..bytes).map_err(|_| refused())?);
            return Ok(Self { buffer, room });
        }
        let buffer = gpu.buffer("weights", bytes + tail, usage | wgpu::BufferUsages::COPY_DST)?;
        let size = wgpu::BufferSize::new(bytes).ok_or_else(refused)?;
        let room = Room::Staged(gpu.queue.write_buffer_with(&buffer, 0, size).ok_or_else(refused)?);
        Ok(Self { buffer, room })
    }

    fn fill(&mut self, source: &dyn ParameterSource, keys: &[&WeightKey]) -> Result<(), GraphError> {
        let ends = keys.iter().scan(0, |end, key| {
            *end += key.bytes() as usize;
            Some(*end)
        });
        let places: Vec<_> = keys.iter().zip(ends).collect();
        // A part of a view cannot be sent to another thread (wgpu 30), so that one at a time copies what it has packed.
        let room = Mutex::new(&mut self.room);
        places.into_par_iter().try_for_each(|(key, end)| {
            let name = &key.parameter.name;
            let numbers =
                source.read(name).map_err(|source| GraphError::Parameter { name: name.to_string(), source })?;
            let packed = key.pack(&numbers);
            drop(numbers);
            source.release(name);
            let mut room = room.lock().unwrap_or_else(PoisonError::into_inner);
            let all = match &mut **room {
                Room::Mapped(view) => view.slice(..end),
                Room::Staged(view) => view.slice(..end),
            };
            let (mut to, mut padding) = all.into_slice(end - key.bytes() as usize..).split_at(packed.len());
            to.copy_from_slice(&packed);
            padding.fill(0);
            Ok(())
        })
    }

    /// Gives the buffer to the device. `copying` is the copy before, which is waited for, and becomes this one.
    fn finish(self, gpu: &Gpu, copying: &mut Option<wgpu::SubmissionIndex>) -> Result<wgpu::Buffer, GraphError> {
        let Self { buffer, room } = self;
        match room {
            Room::Mapped(view) => {
                drop(view);
                buffer.unmap();
            }
            Room::Staged(view) => {
                drop(view);
                let copy = gpu.queue.submit([]);
                if let Some(before) = copying.replace(copy) {
                    gpu.wait_for(before)?;
                }
            }
        }
        Ok(buffer)
    }
}
