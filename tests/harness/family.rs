//! Families of kernel variants, and the device each runs on, or why it does not.

use std::sync::OnceLock;

use omnix_kernels::{Caps, Cooperative, Gpu, Tier, adapter};

/// A family of variants that a test runs with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// The variants that the device chooses.
    Device,
    /// The software device's variants, as its processor's vector registers choose them.
    Software,
    /// The software device's variants for the other kind of processor.
    OtherRegisters,
    /// The variants of every WebGPU device.
    Baseline,
    /// The GPU's variants without optional features.
    Gpu,
    /// With subgroups.
    Subgroup,
    /// With subgroups, where there are any, and f16.
    Half,
    /// With cooperative matrices too.
    Cooperative,
    /// As `Baseline`, on a device that is no more than a browser's: WebGPU's default limits, no features, and wgpu in its strict mode.
    StrictBaseline,
    /// As `Gpu`, on such a device.
    StrictGpu,
}

impl Family {
    /// Where kernels have a variant a tier.
    pub const TIERS: &[Self] = &[Self::Software, Self::Baseline, Self::Gpu, Self::StrictBaseline, Self::StrictGpu];
    /// Where the GPU's variants differ by features.
    pub const FAMILIES: &[Self] = &[
        Self::Software,
        Self::Baseline,
        Self::Gpu,
        Self::Subgroup,
        Self::Half,
        Self::Cooperative,
        Self::StrictBaseline,
        Self::StrictGpu,
    ];
    /// Where products choose by registers too.
    pub const PRODUCTS: &[Self] = &[
        Self::Software,
        Self::OtherRegisters,
        Self::Baseline,
        Self::Gpu,
        Self::Subgroup,
        Self::Half,
        Self::Cooperative,
        Self::StrictBaseline,
        Self::StrictGpu,
    ];

    /// As it stands in the name of a trial.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Software => "software",
            Self::OtherRegisters => "software_other_registers",
            Self::Baseline => "baseline",
            Self::Gpu => "gpu",
            Self::Subgroup => "gpu_subgroup",
            Self::Half => "gpu_f16",
            Self::Cooperative => "gpu_cooperative",
            Self::StrictBaseline => "strict_baseline",
            Self::StrictGpu => "strict_gpu",
        }
    }

    /// The device with these variants.
    ///
    /// # Errors
    /// What the device lacks for them.
    pub fn device(self) -> Result<Gpu, String> {
        let gpu = if matches!(self, Self::StrictBaseline | Self::StrictGpu) { strict() } else { gpu() };
        let caps = gpu.caps.clone();
        let tier = caps.tier;
        let plain = Cooperative::default();
        let lacks = |what: &str| {
            let info = gpu.device.adapter_info();
            Err(format!("{} ({}) has no {what}", info.name, info.driver_info.trim()))
        };
        let gpu_caps = caps.clone().with_tier(Tier::Gpu);
        let caps = match self {
            Self::Software | Self::OtherRegisters if tier != Tier::Software => {
                return lacks("subgroups of exactly 8 lanes and 64-bit integers on a processor");
            }
            Self::Subgroup | Self::Cooperative if caps.subgroup.is_none() => return lacks("subgroups"),
            Self::Half if !caps.f16 => return lacks("f16"),
            Self::Cooperative if !caps.cooperative.any() => return lacks("cooperative matrices"),
            Self::Device | Self::Software => caps,
            Self::OtherRegisters => {
                let registers = if caps.weight_windows() { 32 } else { 16 };
                caps.with_vector_registers(registers)
            }
            Self::Baseline | Self::StrictBaseline => caps.with_tier(Tier::Baseline),
            Self::Gpu | Self::StrictGpu => gpu_caps.with_subgroup(None).with_f16(false).with_cooperative(plain),
            Self::Subgroup => gpu_caps.with_f16(false).with_cooperative(plain),
            Self::Half => gpu_caps.with_cooperative(plain),
            Self::Cooperative => gpu_caps,
        };
        Ok(gpu.with_caps(caps))
    }
}

/// The one device of this process. A missing device fails the test: nothing is skipped.
///
/// `OMNIX_DEVICE` picks it by index or part of its name; `VK_DRIVER_FILES` picks the driver.
///
/// # Panics
/// If there is no device.
pub fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        let wanted = std::env::var("OMNIX_DEVICE").ok();
        let adapter = adapter::choose(wanted.as_deref()).expect("the tests need a device: run tools/setup");
        let (device, queue, products) = adapter::open_experimental(&adapter).expect("the device opens");
        let gpu = Gpu::new(&device, &queue);
        gpu.with_caps(gpu.caps.clone().with_cooperative(products))
    })
}

/// The same adapter as a browser would give it: WebGPU's default limits, no features, and nothing beside the standard accepted.
///
/// # Panics
/// If it does not open: every adapter that the kernels run on has WebGPU's default limits.
pub fn strict() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.flags |= wgpu::InstanceFlags::STRICT_WEBGPU_COMPLIANCE;
        let instance = wgpu::Instance::new(descriptor);
        let wanted = gpu().device.adapter_info();
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        let adapter = adapters
            .into_iter()
            .find(|adapter| {
                let info = adapter.get_info();
                (info.name == wanted.name) && info.backend == wanted.backend && info.driver == wanted.driver
            })
            .expect("the adapter conforms to WebGPU");
        let mut required_limits = wgpu::Limits::default();
        required_limits.zero_native_only();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("strict"),
            required_features: wgpu::Features::empty(),
            required_limits,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("the strict device opens");
        Gpu::new(&device, &queue)
    })
}

/// The device with each tier of variants that it can run, for tests that compare what tiers compute.
#[must_use]
pub fn tiers() -> Vec<Gpu> {
    [Family::Baseline, Family::Gpu, Family::Software].into_iter().filter_map(|family| family.device().ok()).collect()
}

/// What is particular about a device's variants, for messages.
#[must_use]
pub fn family(gpu: &Gpu) -> String {
    let with = |on: bool, what: &str| if on && gpu.caps.tier == Tier::Gpu { format!(" {what}") } else { String::new() };
    format!(
        "{}{}{}{}",
        gpu.caps.tier,
        with(gpu.caps.subgroup.is_some(), "subgroup"),
        with(gpu.caps.f16, "f16"),
        with(gpu.caps.cooperative.any(), "cooperative")
    )
}

/// Whether kernels round operands to f16 on this device.
#[must_use]
pub fn rounds(gpu: &Gpu) -> bool {
    gpu.caps.tier == Tier::Gpu && gpu.caps.f16
}

/// The device with a small binding limit, so that modest tensors are split.
#[must_use]
pub fn with_max_binding(gpu: &Gpu, bytes: u64) -> Gpu {
    gpu.with_caps(Caps { max_binding: bytes, ..gpu.caps.clone() })
}
