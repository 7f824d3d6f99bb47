//! A list of dispatches made ready once and encoded many times.

use std::ops::Range;
use std::sync::Arc;

use omnix_shaders::Access;

use crate::caps::UNIFORM_WINDOW;
use crate::gpu::Pipeline;
use crate::{Arg, Dispatch, Gpu, KernelError};

/// A tensor in a buffer: `offset` is a multiple of the device's alignment.
#[derive(Clone, Debug)]
pub struct BufferSlice {
    /// The buffer; it carries every usage its readers need (storage, and uniform for windows).
    pub buffer: wgpu::Buffer,
    /// First byte of the tensor.
    pub offset: u64,
    /// Bytes of the tensor.
    pub size: u64,
}

impl From<wgpu::Buffer> for BufferSlice {
    fn from(buffer: wgpu::Buffer) -> Self {
        let size = buffer.size();
        Self { buffer, offset: 0, size }
    }
}

/// Dispatches with their pipelines, bind groups and parameters.
#[derive(Debug)]
pub struct Program {
    steps: Vec<Step>,
}

#[derive(Debug)]
struct Step {
    pipeline: Arc<Pipeline>,
    group: wgpu::BindGroup,
    params: u32,
    groups: [u32; 3],
}

/// lavapipe maps memory for every bind group and crashes when the system gives no more maps: Linux allows 65,530 a process.
const MAX_ON_CPU: usize = 50_000;
/// Bytes of such a map.
const CPU_MAP: u64 = 4096;

/// Distance of two parameter blocks: WebGPU's uniform offset alignment.
const PARAMS_STRIDE: u64 = 256;

impl Program {
    /// Makes `dispatches` ready; each comes with the arguments of its kernel.
    ///
    /// # Errors
    /// When a pipeline cannot be made or memory for the parameters runs out.
    pub fn new<'a>(
        gpu: &Gpu,
        dispatches: impl IntoIterator<Item = (&'a Dispatch, &'a [BufferSlice])>,
    ) -> Result<Self, KernelError> {
        let dispatches: Vec<_> = dispatches.into_iter().collect();
        if dispatches.len() > MAX_ON_CPU && gpu.device.adapter_info().device_type == wgpu::DeviceType::Cpu {
            let what = format!("bind groups of {} dispatches", dispatches.len());
            return Err(KernelError::OutOfMemory { what, bytes: dispatches.len() as u64 * CPU_MAP });
        }
        let bytes = dispatches.len().max(1) as u64 * PARAMS_STRIDE;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = gpu.buffer("parameters", bytes, usage)?;
        let mut image = vec![0u8; bytes as usize];
        let mut steps = Vec::with_capacity(dispatches.len());
        for (i, (dispatch, args)) in dispatches.into_iter().enumerate() {
            let at = i * PARAMS_STRIDE as usize;
            image[at..at + dispatch.params.len()].copy_from_slice(&dispatch.params);
            let pipeline = gpu.pipeline(dispatch.shader)?;
            let group = bind(gpu, &pipeline, dispatch, args, &params);
            steps.push(Step { pipeline, group, params: at as u32, groups: dispatch.groups });
        }
        gpu.queue.write_buffer(&params, 0, &image);
        Ok(Self { steps })
    }

    /// Number of dispatches.
    #[must_use]
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is nothing to do.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Records the dispatches `range` into an open pass.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>, range: Range<usize>) {
        for step in &self.steps[range] {
            pass.set_pipeline(&step.pipeline.pipeline);
            pass.set_bind_group(0, &step.group, &[step.params]);
            let [x, y, z] = step.groups;
            pass.dispatch_workgroups(x, y, z);
        }
    }
}

fn bind(
    gpu: &Gpu,
    pipeline: &Pipeline,
    dispatch: &Dispatch,
    args: &[BufferSlice],
    params: &wgpu::Buffer,
) -> wgpu::BindGroup {
    let mut entries = vec![wgpu::BindGroupEntry {
        binding: 0,
        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: params,
            offset: 0,
            size: wgpu::BufferSize::new(u64::from(dispatch.shader.params_size)),
        }),
    }];
    for (i, (window, info)) in dispatch.windows.iter().zip(&dispatch.shader.bindings[1..]).enumerate() {
        let uniform = info.access == Access::Uniform;
        let (buffer, offset, size) = if window.arg == Arg::ABSENT {
            (gpu.absent(), 0, gpu.absent().size())
        } else {
            let slice = &args[usize::from(window.arg.0)];
            (&slice.buffer, slice.offset + window.offset, window.size.unwrap_or(slice.size - window.offset))
        };
        // A uniform window is always bound whole: the shader declares it so.
        let size = if uniform { UNIFORM_WINDOW } else { size };
        entries.push(wgpu::BindGroupEntry {
            binding: i as u32 + 1,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset,
                size: wgpu::BufferSize::new(size),
            }),
        });
    }
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(dispatch.shader.kernel),
        layout: &pipeline.layout,
        entries: &entries,
    })
}
