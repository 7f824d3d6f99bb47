//! Runs one kernel on host arrays and reads the result: for tests, benches and one-off steps.

use crate::caps::UNIFORM_WINDOW;
use crate::dispatch::round_up;
use crate::readback::read;
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
    /// An output or scratch tensor of this number of 32-bit words, filled with NaN bits before the run.
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

/// Uploads, runs and reads argument `out` back as f32: the whole life of a kernel test.
///
/// # Errors
/// As [`execute`].
pub fn run(gpu: &Gpu, dispatches: &[Dispatch], args: &[HostArg<'_>], out: usize) -> Result<Vec<f32>, KernelError> {
    let slices = upload(gpu, args)?;
    execute(gpu, dispatches, &slices)?;
    read(gpu, &slices[out])
}
