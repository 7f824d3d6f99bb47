//! Runs one kernel on host arrays and reads the result: for tests, benches and one-off steps.

use crate::caps::UNIFORM_WINDOW;
use crate::dispatch::round_up;
use crate::{BufferSlice, Dispatch, Gpu, KernelError, Program};

/// An argument given from the host, in the order of the kernel's `Arg` constants.
#[derive(Clone, Copy, Debug)]
pub enum HostArg<'a> {
    /// Numbers to upload.
    F32(&'a [f32]),
    /// Indices to upload.
    U32(&'a [u32]),
    /// Bytes to upload, such as packed weights.
    Bytes(&'a [u8]),
    /// An output or scratch tensor of so many 32-bit words, filled with NaN bits before the run.
    Out(usize),
}

/// Uploads `args`; every buffer can be bound as storage and, with its tail, as a uniform window.
///
/// # Errors
/// When device memory runs out.
pub fn upload(gpu: &Gpu, args: &[HostArg<'_>]) -> Result<Vec<BufferSlice>, KernelError> {
    args.iter()
        .map(|arg| {
            let fill;
            let bytes: &[u8] = match arg {
                HostArg::F32(values) => bytemuck::cast_slice(values),
                HostArg::U32(values) => bytemuck::cast_slice(values),
                HostArg::Bytes(bytes) => bytes,
                HostArg::Out(words) => {
                    // A NaN pattern: a number the kernel fails to write cannot pass for a result.
                    fill = vec![0xff; words * 4];
                    &fill
                }
            };
            let size = round_up(bytes.len() as u64, 4).max(4);
            let usage = wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::UNIFORM
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC;
            let buffer = gpu.buffer("argument", round_up(size, 256) + UNIFORM_WINDOW, usage)?;
            gpu.queue.write_buffer(&buffer, 0, bytes);
            Ok(BufferSlice { buffer, offset: 0, size })
        })
        .collect()
}

/// Runs `dispatches` once over `args` and waits.
///
/// # Errors
/// When a pipeline cannot be made, memory runs out or the device is lost.
pub fn execute(gpu: &Gpu, dispatches: &[Dispatch], args: &[BufferSlice]) -> Result<(), KernelError> {
    let program = Program::new(gpu, dispatches.iter().map(|d| (d, args)))?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    program.encode(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), 0..program.len());
    gpu.queue.submit([encoder.finish()]);
    gpu.wait()
}

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

/// Uploads, runs and reads argument `out` back as f32: the whole life of a kernel test.
///
/// # Errors
/// As [`execute`].
pub fn run(gpu: &Gpu, dispatches: &[Dispatch], args: &[HostArg<'_>], out: usize) -> Result<Vec<f32>, KernelError> {
    let slices = upload(gpu, args)?;
    execute(gpu, dispatches, &slices)?;
    read(gpu, &slices[out])
}
