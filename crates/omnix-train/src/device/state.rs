//! The lists of trained numbers on a device: weights, moments, gradients, averages, an arena a buffer.

use omnix_graph::Bindings;
use omnix_graph::passes::adopt::{gradient_output, parameter_input};
use omnix_kernels::{BufferSlice, Gpu, KernelError, readback};

use crate::groups::{Layout, Slot};

/// What a list's buffers can be used for.
const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);

/// One list, a buffer for each arena.
#[derive(Clone, Debug)]
pub(super) struct List {
    arenas: Vec<wgpu::Buffer>,
}

impl List {
    /// Zeros.
    pub(super) fn new(gpu: &Gpu, layout: &Layout, what: &str) -> Result<Self, KernelError> {
        let buffer = |arena: &crate::groups::Arena| gpu.buffer(what, arena.range.len() as u64 * 4, USAGE);
        Ok(Self { arenas: layout.arenas.iter().map(buffer).collect::<Result<_, _>>()? })
    }

    /// All of an arena.
    pub(super) fn arena(&self, index: usize) -> BufferSlice {
        self.arenas[index].clone().into()
    }

    /// A tensor of the list.
    pub(super) fn tensor(&self, layout: &Layout, slot: &Slot) -> BufferSlice {
        let start = slot.range.start - layout.arenas[slot.arena].range.start;
        BufferSlice {
            buffer: self.arenas[slot.arena].clone(),
            offset: start as u64 * 4,
            size: slot.range.len() as u64 * 4,
        }
    }

    /// The numbers of an arena.
    pub(super) fn read(&self, gpu: &Gpu, index: usize) -> Result<Vec<f32>, KernelError> {
        readback::read(gpu, &self.arena(index))
    }

    /// Replaces the numbers of an arena.
    pub(super) fn write(&self, gpu: &Gpu, index: usize, numbers: &[f32]) -> Result<(), KernelError> {
        gpu.queue.write_buffer(&self.arenas[index], 0, bytemuck::cast_slice(numbers));
        // What is written waits in staging memory until it is submitted.
        gpu.queue.submit([]);
        gpu.wait()
    }
}

/// Where a graph finds the tensors that are trained.
pub(super) fn weights_of(layout: &Layout, weights: &List) -> Bindings {
    layout.slots.iter().map(|slot| (parameter_input(&slot.name), weights.tensor(layout, slot))).collect()
}

/// Where a graph leaves their gradients.
pub(super) fn gradients_of(layout: &Layout, gradients: &List) -> Bindings {
    layout.slots.iter().map(|slot| (gradient_output(&slot.name), gradients.tensor(layout, slot))).collect()
}
