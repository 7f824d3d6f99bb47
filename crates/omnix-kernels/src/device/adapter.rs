//! Finding adapters and opening a device with what the kernels can use.
//!
//! The engine itself borrows the host's device; this is for programs that have none of their own: the
//! command line, tests and benches.

#[cfg(feature = "experimental")]
use crate::caps::Cooperative;
use crate::{KernelError, host_memory};

/// Features the kernels use where an adapter has them; none is required.
#[must_use]
pub fn wanted_features() -> wgpu::Features {
    wgpu::Features::SUBGROUP
        | wgpu::Features::TIMESTAMP_QUERY
        | wgpu::Features::SHADER_F16
        | wgpu::Features::SHADER_INT64
}

/// The backends this build has that can compute.
fn backends() -> wgpu::Backends {
    wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12 | wgpu::Backends::BROWSER_WEBGPU
}

/// Every adapter, GPUs before software devices, otherwise in the order the system gives.
pub async fn enumerate_async() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends();
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = instance.enumerate_adapters(backends()).await;
    adapters.sort_by_key(|a| match a.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

/// Why `adapter` will not do, one line a reason; empty if it will.
#[must_use]
pub fn shortcomings(adapter: &wgpu::Adapter) -> Vec<String> {
    let mut reasons = below(&adapter.limits());
    if !adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS) {
        reasons.push("has no compute shaders".to_owned());
    }
    reasons
}

/// Which limits are below what every WebGPU device has, one line a limit.
fn below(have: &wgpu::Limits) -> Vec<String> {
    let need = wgpu::Limits::default();
    let mut reasons = Vec::new();
    let mut at_least = |what: &str, have: u64, need: u64| {
        if have < need {
            reasons.push(format!("{what} is {have}, at least {need} is needed"));
        }
    };
    at_least("the largest storage binding", have.max_storage_buffer_binding_size, need.max_storage_buffer_binding_size);
    at_least("the largest buffer", have.max_buffer_size, need.max_buffer_size);
    at_least(
        "the number of storage buffers a stage",
        u64::from(have.max_storage_buffers_per_shader_stage),
        u64::from(need.max_storage_buffers_per_shader_stage),
    );
    at_least("the largest uniform binding", have.max_uniform_buffer_binding_size, need.max_uniform_buffer_binding_size);
    at_least(
        "workgroup memory",
        u64::from(have.max_compute_workgroup_storage_size),
        u64::from(need.max_compute_workgroup_storage_size),
    );
    at_least(
        "the number of invocations a workgroup",
        u64::from(have.max_compute_invocations_per_workgroup),
        u64::from(need.max_compute_invocations_per_workgroup),
    );
    reasons
}

/// Picks an adapter: by index, by a part of its name (any case), or the first that will do.
///
/// # Errors
/// [`KernelError::NoAdapter`] when there is none at all, none that matches, or only such as are too small.
pub async fn choose_async(wanted: Option<&str>) -> Result<wgpu::Adapter, KernelError> {
    let adapters = enumerate_async().await;
    let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    let none = |reason: String| KernelError::NoAdapter { reason };
    if adapters.is_empty() {
        return Err(none("this machine offers no Vulkan, Metal or DX12 device".to_owned()));
    }
    let listed = || names.iter().enumerate().map(|(i, n)| format!("{i}: {n}")).collect::<Vec<_>>().join(", ");
    let index = match wanted {
        None => adapters.iter().position(|a| shortcomings(a).is_empty()).unwrap_or(0),
        Some(text) => {
            let by_index = text.parse::<usize>().ok().filter(|i| *i < adapters.len());
            let lower = text.to_lowercase();
            by_index.or_else(|| names.iter().position(|n| n.to_lowercase().contains(&lower))).ok_or_else(|| {
                none(format!("no device has the index or a name with `{text}`; by index the devices are {}", listed()))
            })?
        }
    };
    let reasons = shortcomings(&adapters[index]);
    if !reasons.is_empty() {
        return Err(none(format!("{} is too small: {}", names[index], reasons.join("; "))));
    }
    adapters.into_iter().nth(index).ok_or_else(|| none("BUG: adapter index".to_owned()))
}

/// Opens `adapter` with all its limits and the wanted features it has.
///
/// # Errors
/// [`KernelError::NoAdapter`] when the driver refuses.
pub async fn open_async(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue), KernelError> {
    request(adapter, wanted_features(), wgpu::ExperimentalFeatures::disabled()).await
}

/// As [`open_async`], with wgpu's experimental cooperative matrices where the adapter has products that kernels can use; the
/// third value goes into [`crate::Caps::with_cooperative`]. A host that lends its own device asks for
/// [`wgpu::Features::EXPERIMENTAL_COOPERATIVE_MATRIX`] and does the same with [`Cooperative::of`].
///
/// Nothing in omnix calls this unless asked (`omnix --experimental`): wgpu does not vouch for the feature. The variants were
/// run on an NVIDIA H200; no driver of CI has it, there a stand-in tests their logic.
///
/// # Errors
/// As [`open_async`].
#[cfg(feature = "experimental")]
pub async fn open_experimental_async(
    adapter: &wgpu::Adapter,
) -> Result<(wgpu::Device, wgpu::Queue, Cooperative), KernelError> {
    let products = Cooperative::of(&adapter.cooperative_matrix_properties());
    let feature = wgpu::Features::EXPERIMENTAL_COOPERATIVE_MATRIX;
    if !products.any() || !adapter.features().contains(feature) {
        let (device, queue) = open_async(adapter).await?;
        return Ok((device, queue, Cooperative::default()));
    }
    #[expect(unsafe_code, reason = "wgpu's way to say that an experimental feature may misbehave")]
    // SAFETY: wgpu asks that the caller accepts undefined behaviour from bugs in code it has not hardened. The only feature taken
    // is cooperative matrices, used only by the shaders of this workspace: validated when it is built, matrices within
    // workgroup memory at constant strides, operations in uniform control flow.
    let token = unsafe { wgpu::ExperimentalFeatures::enabled() };
    let (device, queue) = request(adapter, wanted_features() | feature, token).await?;
    Ok((device, queue, products))
}

async fn request(
    adapter: &wgpu::Adapter,
    features: wgpu::Features,
    experimental_features: wgpu::ExperimentalFeatures,
) -> Result<(wgpu::Device, wgpu::Queue), KernelError> {
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("omnix"),
        required_features: adapter.features() & features,
        required_limits: adapter.limits(),
        experimental_features,
        memory_hints: wgpu::MemoryHints::MemoryUsage,
        trace: wgpu::Trace::Off,
    };
    let opened = match host_memory::open(adapter, &descriptor) {
        Some(opened) => opened,
        None => adapter.request_device(&descriptor).await,
    };
    opened.map_err(|e| KernelError::NoAdapter { reason: format!("{} cannot be opened: {e}", adapter.get_info().name) })
}

#[cfg(not(target_arch = "wasm32"))]
pub use blocking::*;

/// The same for programs with a thread to spare: blocking.
#[cfg(not(target_arch = "wasm32"))]
mod blocking {
    use crate::KernelError;
    #[cfg(feature = "experimental")]
    use crate::caps::Cooperative;

    /// As [`super::enumerate_async`].
    #[must_use]
    pub fn enumerate() -> Vec<wgpu::Adapter> {
        pollster::block_on(super::enumerate_async())
    }

    /// As [`super::choose_async`].
    ///
    /// # Errors
    /// As there.
    pub fn choose(wanted: Option<&str>) -> Result<wgpu::Adapter, KernelError> {
        pollster::block_on(super::choose_async(wanted))
    }

    /// As [`super::open_async`].
    ///
    /// # Errors
    /// As there.
    pub fn open(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue), KernelError> {
        pollster::block_on(super::open_async(adapter))
    }

    /// As [`super::open_experimental_async`].
    ///
    /// # Errors
    /// As there.
    #[cfg(feature = "experimental")]
    pub fn open_experimental(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue, Cooperative), KernelError> {
        pollster::block_on(super::open_experimental_async(adapter))
    }
}

#[cfg(test)]
mod tests {
    use super::below;

    #[test]
    fn an_adapter_too_small_is_told_why() {
        let enough = wgpu::Limits::default();
        assert!(below(&enough).is_empty());
        let small = wgpu::Limits {
            max_storage_buffer_binding_size: 1 << 20,
            max_storage_buffers_per_shader_stage: 4,
            ..enough
        };
        let reasons = below(&small).join("; ");
        assert!(reasons.contains("largest storage binding is 1048576, at least 134217728 is needed"), "{reasons}");
        assert!(reasons.contains("storage buffers a stage is 4, at least 8 is needed"), "{reasons}");
    }
}
