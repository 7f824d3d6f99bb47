//! Copies from a device to the host, without waiting for what is submitted later.

use crate::{BufferSlice, Gpu, KernelError};

/// A slice's bytes on their way to the host.
#[derive(Debug)]
pub struct Readback {
    staging: wgpu::Buffer,
    copied: wgpu::SubmissionIndex,
}

impl Readback {
    /// Submits the copy. What is submitted later may overwrite the slice and runs while the bytes wait here.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn start(gpu: &Gpu, slice: &BufferSlice) -> Result<Self, KernelError> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = gpu.buffer("readback", slice.size, usage)?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&slice.buffer, slice.offset, &staging, 0, slice.size);
        let copied = gpu.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| ());
        Ok(Self { staging, copied })
    }

    /// Waits for the copy, and for nothing submitted after it, and takes the bytes as numbers of type `T`.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn finish<T: bytemuck::Pod>(self, gpu: &Gpu) -> Result<Vec<T>, KernelError> {
        gpu.wait_for(self.copied)?;
        let mapped = self.staging.get_mapped_range(..);
        let mapped = mapped.map_err(|e| KernelError::DeviceLost { message: e.to_string() })?;
        Ok(bytemuck::pod_collect_to_vec(&mapped))
    }
}

/// Reads a whole slice back as 32-bit words of type `T`.
///
/// # Errors
/// When memory runs out or the device is lost.
pub fn read<T: bytemuck::Pod>(gpu: &Gpu, slice: &BufferSlice) -> Result<Vec<T>, KernelError> {
    Readback::start(gpu, slice)?.finish(gpu)
}
