//! Having the driver compile a kernel before it is needed.
//!
//! lavapipe makes machine code when a pipeline is dispatched first, one kernel after another on its queue's thread, 0.1 to 4 s each, and
//! keeps it in a cache on disk. A dispatch of no workgroups is enough for that, and another device of the same adapter has a
//! thread of its own: what it compiled, the first finds in the cache.

use std::time::{Duration, Instant};

use omnix_shaders::Access;

use crate::caps::UNIFORM_WINDOW;
use crate::{Arg, BufferSlice, Dispatch, Gpu, KernelError, Program};

/// Makes the pipeline of `dispatch` and has the driver compile it; waits, and gives the time that the driver took.
///
/// # Errors
/// When the pipeline cannot be made or the device is lost.
pub fn compile(gpu: &Gpu, dispatch: &Dispatch) -> Result<Duration, KernelError> {
    gpu.prepare(dispatch)?;
    let started = Instant::now();
    // A device that is lost or full meanwhile is an error here, not a panic in wgpu's own handler.
    let scopes =
        [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::OutOfMemory].map(|f| gpu.device.push_error_scope(f));
    let done = dispatch_nothing(gpu, dispatch);
    let (kernel, variant) = (dispatch.shader.kernel, dispatch.shader.variant);
    let failed = move |error: wgpu::Error| KernelError::Pipeline { kernel, variant, message: error.to_string() };
    let settled = scopes.into_iter().rev().map(|scope| gpu.settle(scope, failed));
    let settled: Vec<_> = settled.collect();
    gpu.check_lost()?;
    done?;
    settled.into_iter().collect::<Result<(), _>>()?;
    Ok(started.elapsed())
}

fn dispatch_nothing(gpu: &Gpu, dispatch: &Dispatch) -> Result<(), KernelError> {
    // Nothing runs, so any two buffers do for what is read and what is written.
    let written = gpu.buffer("nothing", UNIFORM_WINDOW, wgpu::BufferUsages::STORAGE)?;
    let slices = [BufferSlice::from(gpu.absent().clone()), BufferSlice::from(written)];
    let arg = |access| Arg(u8::from(access == Access::ReadWrite)).into();
    let empty = Dispatch {
        windows: dispatch.shader.bindings.iter().skip(1).map(|binding| arg(binding.access)).collect(),
        groups: [0, 1, 1],
        ..dispatch.clone()
    };
    let program = Program::new(gpu, [(&empty, slices.as_slice())])?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        program.encode(&mut pass, 0..program.len());
    }
    gpu.wait_for(gpu.queue.submit([encoder.finish()]))
}
