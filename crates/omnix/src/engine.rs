//! The device.

use omnix_kernels::{Caps, Gpu, adapter};
use serde::Serialize;

use crate::error::OmnixError;

/// A borrowed device with the pipelines made on it. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Engine {
    gpu: Gpu,
}

/// What the device says about itself.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceInfo {
    /// Adapter name.
    pub name: String,
    /// Backend: Vulkan, Metal, …
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// Discrete GPU, CPU, …
    pub kind: String,
    /// Family of kernel variants: software, baseline, gpu.
    pub tier: String,
}

impl Engine {
    /// Runs on the host's device and queue, whose device-lost callback it takes; several engines on one device share it, and a
    /// host with a callback of its own calls [`Gpu::report_lost`] from it. Ask for the features of [`Engine::wanted_features`] and
    /// the adapter's limits when opening the device; with less it works too, slower or on smaller images.
    #[must_use]
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        Self { gpu: Gpu::new(device, queue) }
    }

    /// Opens a device of its own: by index or part of its name, or the best there is.
    ///
    /// # Errors
    /// When there is no adapter, or its limits are too small.
    pub async fn open_async(wanted: Option<&str>) -> Result<Self, OmnixError> {
        let adapter = adapter::choose_async(wanted).await?;
        let (device, queue) = adapter::open_async(&adapter).await?;
        Ok(Self { gpu: Gpu::new(&device, &queue).from_adapter(&adapter) })
    }

    /// As [`Engine::open_async`], with wgpu's experimental cooperative matrices (tensor cores) where the adapter has products
    /// that kernels can use; without them the same as `open`. A host with a device of its own that opted in says so
    /// by [`Engine::with_caps`] and [`Caps::with_cooperative`].
    ///
    /// # Errors
    /// As [`Engine::open_async`].
    #[cfg(feature = "experimental")]
    pub async fn open_experimental_async(wanted: Option<&str>) -> Result<Self, OmnixError> {
        let adapter = adapter::choose_async(wanted).await?;
        let (device, queue, products) = adapter::open_experimental_async(&adapter).await?;
        let engine = Self { gpu: Gpu::new(&device, &queue).from_adapter(&adapter) };
        let caps = engine.caps().clone().with_cooperative(products);
        Ok(engine.with_caps(caps))
    }

    /// The same device with other variants or limits, for tests and benches.
    #[must_use]
    pub fn with_caps(&self, caps: Caps) -> Self {
        Self { gpu: self.gpu.with_caps(caps) }
    }

    /// Features that make the engine faster where the adapter has them; none is required. A software Vulkan device that is opened
    /// with the extension `VK_EXT_external_memory_host` too, as omnix opens its own on Linux, takes weights and intermediates from the
    /// program's memory; others get weights by copies.
    #[must_use]
    pub fn wanted_features() -> wgpu::Features {
        adapter::wanted_features()
    }

    /// Why this is a software device, in words for a person, such as "no GPU adapter was found"; `None` on a GPU. `wanted` is what
    /// the user asked for by name or index.
    #[cfg(not(target_arch = "wasm32"))]
    #[must_use]
    pub fn why_software(&self, wanted: Option<&str>) -> Option<String> {
        omnix_kernels::why_software(&self.gpu.device.adapter_info(), wanted)
    }

    /// The facts that decide variants and chunks.
    #[must_use]
    pub fn caps(&self) -> &Caps {
        &self.gpu.caps
    }

    /// The device, queue and pipelines.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What the device says about itself.
    #[must_use]
    pub fn info(&self) -> DeviceInfo {
        let info = self.gpu.device.adapter_info();
        DeviceInfo {
            name: info.name,
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            kind: format!("{:?}", info.device_type),
            tier: self.gpu.caps.tier.to_string(),
        }
    }
}
