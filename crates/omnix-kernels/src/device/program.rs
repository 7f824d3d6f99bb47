//! A list of dispatches made ready once and encoded many times.

use std::ops::Range;
use std::sync::Arc;

use omnix_shaders::Access;
use rustc_hash::FxHashMap;
use smallvec::{SmallVec, smallvec};

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
    /// Offsets of the parameters and of every uniform window, in binding order.
    offsets: SmallVec<[u32; 4]>,
    groups: [u32; 3],
}

/// Distance of two parameter blocks: WebGPU's uniform offset alignment.
const PARAMS_STRIDE: u64 = 256;

/// Where the bindings of a dispatch point, but for what dynamic offsets say: dispatches that agree share a bind group.
type Places = SmallVec<[(wgpu::Buffer, u64, u64); 8]>;

impl Program {
    /// Makes `dispatches` ready; each comes with the arguments of its kernel.
    ///
    /// The windows of weights that a product walks through differ in dynamic offsets alone, so a node of hundreds of
    /// dispatches has one bind group. lavapipe maps memory for each, and Linux gives a process 65,530 maps.
    ///
    /// # Errors
    /// When a pipeline cannot be made or memory for the parameters runs out.
    pub fn new<'a>(
        gpu: &Gpu,
        dispatches: impl IntoIterator<Item = (&'a Dispatch, &'a [BufferSlice])>,
    ) -> Result<Self, KernelError> {
        let dispatches: Vec<_> = dispatches.into_iter().collect();
        let bytes = dispatches.len().max(1) as u64 * PARAMS_STRIDE;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = gpu.buffer("parameters", bytes, usage)?;
        let mut image = vec![0u8; bytes as usize];
        let mut steps = Vec::with_capacity(dispatches.len());
        #[expect(
            clippy::mutable_key_type,
            reason = "a buffer is hashed and compared by its identity, which never changes"
        )]
        let mut known: FxHashMap<(&str, &str, Places), wgpu::BindGroup> = FxHashMap::default();
        for (i, (dispatch, args)) in dispatches.into_iter().enumerate() {
            let at = i * PARAMS_STRIDE as usize;
            image[at..at + dispatch.params.len()].copy_from_slice(&dispatch.params);
            let pipeline = gpu.pipeline(dispatch.shader)?;
            let (places, offsets) = places(gpu, dispatch, args, &params, at as u32);
            let key = (dispatch.shader.kernel, dispatch.shader.variant, places);
            let group = match known.get(&key) {
                Some(group) => group.clone(),
                None => {
                    let made = bind(gpu, &pipeline, dispatch.shader.kernel, &key.2);
                    known.insert(key, made.clone());
                    made
                }
            };
            steps.push(Step { pipeline, group, offsets, groups: dispatch.groups });
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
            pass.set_bind_group(0, &step.group, &step.offsets);
            let [x, y, z] = step.groups;
            pass.dispatch_workgroups(x, y, z);
        }
    }
}

/// What each binding of `dispatch` points to, and the dynamic offsets.
fn places(
    gpu: &Gpu,
    dispatch: &Dispatch,
    args: &[BufferSlice],
    params: &wgpu::Buffer,
    at: u32,
) -> (Places, SmallVec<[u32; 4]>) {
    let mut places: Places = smallvec![(params.clone(), 0, u64::from(dispatch.shader.params_size))];
    let mut offsets: SmallVec<[u32; 4]> = smallvec![at];
    for (window, info) in dispatch.windows.iter().zip(&dispatch.shader.bindings[1..]) {
        let (buffer, offset, size) = if window.arg == Arg::ABSENT {
            (gpu.absent(), 0, gpu.absent().size())
        } else {
            let slice = &args[usize::from(window.arg.0)];
            (&slice.buffer, slice.offset + window.offset, window.size.unwrap_or(slice.size - window.offset))
        };
        if info.access == Access::Uniform {
            // A uniform window is always bound whole: the shader declares it so. Buffers stay below 4 GiB on
            // the devices that use windows.
            offsets.push(offset as u32);
            places.push((buffer.clone(), 0, UNIFORM_WINDOW));
        } else {
            places.push((buffer.clone(), offset, size));
        }
    }
    (places, offsets)
}

fn bind(gpu: &Gpu, pipeline: &Pipeline, kernel: &str, places: &Places) -> wgpu::BindGroup {
    let entries: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(i, (buffer, offset, size))| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: *offset,
                size: wgpu::BufferSize::new(*size),
            }),
        })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: Some(kernel), layout: &pipeline.layout, entries: &entries };
    gpu.device.create_bind_group(&descriptor)
}
