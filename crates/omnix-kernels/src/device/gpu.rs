//! A borrowed device with the pipelines made on it so far.

use std::sync::{Arc, Mutex, PoisonError};

use omnix_shaders::{Access, Shader};
use rustc_hash::FxHashMap;

use super::lost::Lost;
use crate::caps::UNIFORM_WINDOW;
use crate::{Caps, Dispatch, HostMemory, KernelError, host_memory};
#[cfg(not(target_arch = "wasm32"))]
use crate::{Cooperative, adapter};

/// A device with its queue, its capabilities, and the pipelines made so far (one per shader). Cheap to clone; the host keeps its
/// own handles.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The host's device.
    pub device: wgpu::Device,
    /// The host's queue.
    pub queue: wgpu::Queue,
    /// Facts that decide the variants.
    pub caps: Caps,
    /// Where the device is from, if that is known.
    adapter: Option<wgpu::Adapter>,
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    pipelines: Mutex<FxHashMap<(&'static str, &'static str), Arc<Made>>>,
    /// Bound where an optional argument is absent.
    absent: wgpu::Buffer,
    lost: Lost,
    /// What a browser found wrong after the call that it belongs to.
    failed: Mutex<Option<KernelError>>,
    /// Whether it imports the program's memory.
    imports: bool,
}

/// A compute pipeline and the layout of its one bind group.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

/// A pipeline, once it is made: locked while it is, so that two threads never make the same one, and never wait for others.
type Made = Mutex<Option<Arc<Pipeline>>>;

/// Bytes of the buffer bound for absent arguments: a full uniform window would also fit.
const ABSENT_BYTES: u64 = 65_536;

/// Smaller buffers are left to the driver: they share an allocation.
const IMPORTED_BYTES: u64 = 1 << 20;

impl Gpu {
    /// Borrows `device` and `queue`. Nothing global is set, but the device-lost callback is taken: wgpu has one per device. Several
    /// `Gpu`s on one device share it, so that each learns of a loss. A host that sets a callback of its own after this calls
    /// [`Gpu::report_lost`] from it.
    #[must_use]
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let caps = Caps::of(device);
        let lost = Lost::watch(device);
        let absent = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("absent"),
            size: ABSENT_BYTES,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM,
            mapped_at_creation: false,
        });
        let imports = host_memory::imports(device);
        let shared = Shared { pipelines: Mutex::default(), absent, lost, failed: Mutex::default(), imports };
        Self { device: device.clone(), queue: queue.clone(), caps, adapter: None, shared: Arc::new(shared) }
    }

    /// The same device, known to be from `adapter`, so that [`Gpu::sibling`] can open others.
    #[must_use]
    pub fn from_adapter(self, adapter: &wgpu::Adapter) -> Self {
        Self { adapter: Some(adapter.clone()), ..self }
    }

    /// Whether [`Gpu::sibling`] can be asked: the adapter is known.
    #[must_use]
    pub fn has_siblings(&self) -> bool {
        self.adapter.is_some()
    }

    /// Another device of the same adapter, with the same facts, but for cooperative matrices, and no pipelines yet; none where the
    /// adapter is not known or refuses.
    #[cfg(not(target_arch = "wasm32"))]
    #[must_use]
    pub fn sibling(&self) -> Option<Self> {
        let (device, queue) = adapter::open(self.adapter.as_ref()?).ok()?;
        // Opened without experimental features.
        let caps = self.caps.clone().with_cooperative(Cooperative::default());
        Some(Self::new(&device, &queue).with_caps(caps))
    }

    /// The same device and pipelines with other variants or limits, for tests and benches.
    #[must_use]
    pub fn with_caps(&self, caps: Caps) -> Self {
        Self { caps, ..self.clone() }
    }

    /// An error if the device has been lost.
    ///
    /// # Errors
    /// [`KernelError::DeviceLost`].
    pub fn check_lost(&self) -> Result<(), KernelError> {
        match self.shared.lost.message() {
            Some(message) => Err(KernelError::DeviceLost { message: message.to_owned() }),
            None => Ok(()),
        }
    }

    /// Says that the device was lost, for hosts whose own device-lost callback has taken the place of this one's.
    pub fn report_lost(&self, message: &str) {
        self.shared.lost.set(message.to_owned());
    }

    /// Keeps an error until the next wait returns it; the first one stays.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn fail(&self, error: KernelError) {
        self.shared.failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    /// An error that was kept for this wait.
    pub(crate) fn failed(&self) -> Result<(), KernelError> {
        self.shared.failed.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    pub(crate) fn absent(&self) -> &wgpu::Buffer {
        &self.shared.absent
    }

    /// Creates a buffer of zeros, or says that memory ran out. A large one lies in the program's memory where the device imports that
    /// ([`Gpu::imports`]).
    ///
    /// # Errors
    /// [`KernelError::OutOfMemory`] with `what` and the size.
    pub fn buffer(&self, what: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, KernelError> {
        let mapped = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::MAP_WRITE;
        if self.imports() && bytes >= IMPORTED_BYTES && !usage.intersects(mapped) {
            let memory = self.host_memory(what, bytes)?;
            memory.populate().map_err(|_| KernelError::OutOfMemory { what: what.to_owned(), bytes })?;
            if let Ok(buffer) = host_memory::import(&self.device, what, memory, usage) {
                self.check_lost()?;
                return Ok(buffer);
            }
        }
        self.create(what, bytes, usage)
    }

    /// Whether [`Gpu::import`] copies nothing: the shaders run on the processor, in its memory, and the Vulkan device was opened by
    /// [`crate::adapter`] or by a host with `VK_EXT_external_memory_host`, on Linux.
    #[must_use]
    pub fn imports(&self) -> bool {
        self.shared.imports
    }

    /// Zeroed memory for a buffer, `bytes` a multiple of 4.
    ///
    /// # Errors
    /// [`KernelError::OutOfMemory`], also when it is more than a buffer can have.
    pub fn host_memory(&self, what: &str, bytes: u64) -> Result<HostMemory, KernelError> {
        self.check_size(what, bytes)?;
        HostMemory::zeroed(bytes).map_err(|_| KernelError::OutOfMemory { what: what.to_owned(), bytes })
    }

    /// Makes memory and what the program has written to it a buffer; by a copy where the device does not import.
    ///
    /// # Errors
    /// [`KernelError::OutOfMemory`].
    pub fn import(
        &self,
        what: &str,
        memory: HostMemory,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, KernelError> {
        let imported =
            if self.imports() { host_memory::import(&self.device, what, memory, usage) } else { Err(memory) };
        self.check_lost()?;
        imported.or_else(|memory| {
            let bytes = memory.len() as u64;
            let buffer = self.create(what, bytes, usage | wgpu::BufferUsages::COPY_DST)?;
            self.queue.write_buffer(&buffer, 0, &memory);
            Ok(buffer)
        })
    }

    fn check_size(&self, what: &str, bytes: u64) -> Result<(), KernelError> {
        let fits = bytes <= self.device.limits().max_buffer_size;
        fits.then_some(()).ok_or_else(|| KernelError::OutOfMemory { what: what.to_owned(), bytes })
    }

    /// A buffer in the driver's memory.
    fn create(&self, what: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, KernelError> {
        self.check_size(what, bytes)?;
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let descriptor = wgpu::BufferDescriptor { label: Some(what), size: bytes, usage, mapped_at_creation: false };
        let buffer = self.device.create_buffer(&descriptor);
        let what = what.to_owned();
        let made = self.settle(scope, move |_| KernelError::OutOfMemory { what, bytes });
        // A lost device returns an invalid buffer and no error.
        self.check_lost()?;
        made.map(|()| buffer)
    }

    /// Memory to write to, which is copied to `bytes` of `buffer` from `offset` on by the submission after it is dropped.
    ///
    /// # Errors
    /// [`KernelError::OutOfMemory`].
    pub fn staging(
        &self,
        buffer: &wgpu::Buffer,
        offset: u64,
        bytes: u64,
    ) -> Result<wgpu::QueueWriteBufferView, KernelError> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let view = wgpu::BufferSize::new(bytes).and_then(|size| self.queue.write_buffer_with(buffer, offset, size));
        let full = move || KernelError::OutOfMemory { what: "staging memory".to_owned(), bytes };
        let made = self.settle(scope, move |_| full());
        self.check_lost()?;
        made.and_then(|()| view.ok_or_else(full))
    }

    /// Makes the pipeline of `dispatch` before it is needed; whoever needs it meanwhile waits for this one. Threads may make
    /// several at once.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn prepare(&self, dispatch: &Dispatch) -> Result<(), KernelError> {
        self.pipeline(dispatch.shader).map(drop)
    }

    /// Whether the pipeline of `dispatch` has been made.
    #[must_use]
    pub fn is_prepared(&self, dispatch: &Dispatch) -> bool {
        let key = (dispatch.shader.kernel, dispatch.shader.variant);
        let pipelines = self.shared.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let cell = pipelines.get(&key).cloned();
        drop(pipelines);
        cell.is_some_and(|cell| cell.try_lock().is_ok_and(|made| made.is_some()))
    }

    /// The pipeline of `shader`, made at first use.
    pub(crate) fn pipeline(&self, shader: &'static Shader) -> Result<Arc<Pipeline>, KernelError> {
        let key = (shader.kernel, shader.variant);
        let cell = {
            let mut pipelines = self.shared.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(pipelines.entry(key).or_default())
        };
        let mut made = cell.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = made.as_ref() {
            return Ok(Arc::clone(found));
        }
        let pipeline = Arc::new(self.make_pipeline(shader)?);
        *made = Some(Arc::clone(&pipeline));
        Ok(pipeline)
    }

    fn make_pipeline(&self, shader: &'static Shader) -> Result<Pipeline, KernelError> {
        let (kernel, variant) = (shader.kernel, shader.variant);
        let features = self.device.features();
        for feature in shader.requires {
            let needed = match *feature {
                "subgroup" => wgpu::Features::SUBGROUP,
                "f16" => wgpu::Features::SHADER_F16,
                "int64" => wgpu::Features::SHADER_INT64,
                _ => wgpu::Features::EXPERIMENTAL_COOPERATIVE_MATRIX,
            };
            if !features.contains(needed) {
                return Err(KernelError::MissingFeature { kernel, variant, feature });
            }
        }
        let label = format!("{kernel}/{variant}");
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(&label), source: wgpu::ShaderSource::Wgsl(shader.wgsl.into()) };
        // wgpu's counters, one in every turn of every loop, cost software devices 2 % of a network and copies a tenth.
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
        #[expect(unsafe_code, reason = "wgpu's way to leave the counters out")]
        // SAFETY: wgpu asks that no shader loops forever. They come from this workspace alone (`Shader` is made in its crate only), and
        // every loop in them is a `for` with a bound and a step (`cargo xtask tidy`): up by a constant, or by a parameter or a
        // built-in value of at least 1, or down by halves, to what its body leaves alone. All other checks stay.
        let module = unsafe { self.device.create_shader_module_trusted(descriptor, checks) };
        let entries: Vec<_> =
            shader.bindings.iter().enumerate().map(|(i, b)| layout_entry(i, b.access, shader)).collect();
        let layout = self
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(&label), entries: &entries });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&label),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&label),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let failed = move |error: wgpu::Error| KernelError::Pipeline { kernel, variant, message: error.to_string() };
        self.settle(scope, failed).map(|()| Pipeline { pipeline, layout })
    }
}

/// Binding 0 is the parameters, one buffer a program, chosen by dynamic offset.
fn layout_entry(index: usize, access: Access, shader: &Shader) -> wgpu::BindGroupLayoutEntry {
    let (ty, dynamic, min) = match (index, access) {
        (0, _) => (wgpu::BufferBindingType::Uniform, true, wgpu::BufferSize::new(u64::from(shader.params_size))),
        // Windows move by dynamic offset too, so that one bind group serves all windows of a tensor.
        (_, Access::Uniform) => (wgpu::BufferBindingType::Uniform, true, wgpu::BufferSize::new(UNIFORM_WINDOW)),
        (_, Access::Read) => (wgpu::BufferBindingType::Storage { read_only: true }, false, None),
        (_, Access::ReadWrite) => (wgpu::BufferBindingType::Storage { read_only: false }, false, None),
    };
    wgpu::BindGroupLayoutEntry {
        binding: index as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: dynamic, min_binding_size: min },
        count: None,
    }
}
