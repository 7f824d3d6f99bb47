//! Shared by all test binaries: the device, seeded numbers, comparison.

pub mod compare;
pub mod rng;

use std::sync::OnceLock;

use omnix_kernels::{Caps, Gpu, Tier, adapter};

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
        let (device, queue) = adapter::open(&adapter).expect("the device opens");
        Gpu::new(&device, &queue)
    })
}

/// The device once for every family of variants it can run.
#[must_use]
pub fn tiers() -> Vec<Gpu> {
    let gpu = gpu();
    let mut tiers = vec![Tier::Baseline, Tier::Gpu];
    if gpu.caps.tier == Tier::Software {
        tiers.push(Tier::Software);
    }
    tiers.into_iter().map(|tier| gpu.with_caps(gpu.caps.clone().with_tier(tier))).collect()
}

/// The device with a small binding limit, so that modest tensors are split.
#[must_use]
pub fn with_max_binding(gpu: &Gpu, bytes: u64) -> Gpu {
    gpu.with_caps(Caps { max_binding: bytes, ..gpu.caps.clone() })
}
