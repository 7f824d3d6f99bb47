//! Shared by all test binaries: the device, seeded numbers, comparison.

pub mod compare;
pub mod rng;

use std::sync::OnceLock;

use omnix_kernels::{Caps, Cooperative, Gpu, Tier, adapter};

pub use compare::{assert_close, relative_error};
pub use rng::Rng;

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

/// The device once for every family of variants it can run, the GPU's without optional features.
#[must_use]
pub fn tiers() -> Vec<Gpu> {
    let gpu = gpu();
    let plain = gpu.caps.clone().with_tier(Tier::Gpu).with_subgroup(None).with_f16(false);
    let mut tiers = vec![gpu.caps.clone().with_tier(Tier::Baseline), plain];
    if gpu.caps.tier == Tier::Software {
        tiers.push(gpu.caps.clone());
    }
    tiers.into_iter().map(|caps| gpu.with_caps(caps)).collect()
}

/// [`tiers`], then the GPU variants with subgroups, with subgroups and f16, and with cooperative matrices too, each where
/// the device has them.
#[must_use]
pub fn families() -> Vec<Gpu> {
    let mut families = tiers();
    let caps = gpu().caps.clone().with_tier(Tier::Gpu);
    if caps.subgroup.is_some() {
        let plain = caps.clone().with_f16(false).with_cooperative(Cooperative::default());
        families.push(gpu().with_caps(plain));
    }
    if caps.f16 {
        families.push(gpu().with_caps(caps.clone().with_cooperative(Cooperative::default())));
    }
    if caps.cooperative.any() {
        families.push(gpu().with_caps(caps));
    }
    families
}

/// What [`families`] distinguishes, for messages.
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

/// `values` as f16 holds them.
#[must_use]
pub fn as_f16(values: &[f32]) -> Vec<f32> {
    values.iter().map(|v| half::f16::from_f32(*v).to_f32()).collect()
}

/// The device with a small binding limit, so that modest tensors are split.
#[must_use]
pub fn with_max_binding(gpu: &Gpu, bytes: u64) -> Gpu {
    gpu.with_caps(Caps { max_binding: bytes, ..gpu.caps.clone() })
}
