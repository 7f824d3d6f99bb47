//! Copies from a device to the host, without waiting for what is submitted later.

use futures_channel::oneshot;

use crate::{BufferSlice, Gpu, KernelError};

/// A slice's bytes on their way to the host.
#[derive(Debug)]
pub struct Readback {
    staging: wgpu::Buffer,
    copied: wgpu::SubmissionIndex,
    mapped: oneshot::Receiver<Result<(), wgpu::BufferAsyncError>>,
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
        let (tell, mapped) = oneshot::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| drop(tell.send(result)));
        Ok(Self { staging, copied, mapped })
    }

    /// Waits for the copy, and for nothing submitted after it, and takes the bytes as numbers of type `T`.
    ///
    /// # Errors
    /// When the device is lost.
    pub async fn finish_async<T: bytemuck::Pod>(self, gpu: &Gpu) -> Result<Vec<T>, KernelError> {
        let lost = |message: String| KernelError::DeviceLost { message };
        // In a browser the mapping itself is waited for.
        if cfg!(not(target_arch = "wasm32")) {
            gpu.wait_for_async(self.copied).await?;
        }
        let mapped = self.mapped.await.map_err(|_| lost("a readback was dropped".to_owned()))?;
        gpu.check_lost()?;
        gpu.failed()?;
        mapped.map_err(|e| lost(e.to_string()))?;
        let mapped = self.staging.get_mapped_range(..).map_err(|e| lost(e.to_string()))?;
        Ok(bytemuck::pod_collect_to_vec(&mapped))
    }

    /// As [`Readback::finish_async`], blocking.
    ///
    /// # Errors
    /// As there.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn finish<T: bytemuck::Pod>(self, gpu: &Gpu) -> Result<Vec<T>, KernelError> {
        pollster::block_on(self.finish_async(gpu))
    }
}

/// Reads a whole slice back as 32-bit words of type `T`.
///
/// # Errors
/// When memory runs out or the device is lost.
pub async fn read_async<T: bytemuck::Pod>(gpu: &Gpu, slice: &BufferSlice) -> Result<Vec<T>, KernelError> {
    Readback::start(gpu, slice)?.finish_async(gpu).await
}

/// As [`read_async`], blocking.
///
/// # Errors
/// As there.
#[cfg(not(target_arch = "wasm32"))]
pub fn read<T: bytemuck::Pod>(gpu: &Gpu, slice: &BufferSlice) -> Result<Vec<T>, KernelError> {
    pollster::block_on(read_async(gpu, slice))
}
