//! What a device offers, as facts, and the tier of kernel variants that follows from them.

use std::fmt;

/// Which family of kernel variants suits a device. A kernel that has no variant of a tier uses its
/// baseline one, which runs everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Tier {
    /// A software rasteriser with subgroups of exactly 8 lanes (lavapipe): register tiles, constant
    /// shuffles, weights through uniform windows, no barriers.
    Software,
    /// Any WebGPU device; also SwiftShader and WARP.
    Baseline,
    /// A GPU: tiles in workgroup memory.
    Gpu,
}

impl fmt::Display for Tier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Software => "software",
            Self::Baseline => "baseline",
            Self::Gpu => "gpu",
        })
    }
}

/// Facts about a device that decide how kernels are recorded. Two equal `Caps` record equal dispatches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caps {
    /// The family of variants in use.
    pub tier: Tier,
    /// Largest storage buffer range a shader may see, in bytes; larger tensors are split.
    pub max_binding: u64,
    /// Largest single buffer, in bytes.
    pub max_buffer: u64,
    /// Alignment of binding offsets, in bytes.
    pub align: u64,
}

/// Bytes of a uniform window: WebGPU's `maxUniformBufferBindingSize`.
pub const UNIFORM_WINDOW: u64 = 65_536;

impl Caps {
    /// WebGPU's default limits: what every device has.
    #[must_use]
    pub fn baseline() -> Self {
        Self { tier: Tier::Baseline, max_binding: 128 << 20, max_buffer: 256 << 20, align: 256 }
    }

    /// Mesa's lavapipe, for plans made without a device.
    #[must_use]
    pub fn lavapipe() -> Self {
        Self { tier: Tier::Software, max_binding: 128 << 20, max_buffer: (2 << 30) - 1, align: 256 }
    }

    /// The facts of `device` as it was opened (features and limits not requested do not count).
    #[must_use]
    pub fn of(device: &wgpu::Device) -> Self {
        let (info, limits, features) = (device.adapter_info(), device.limits(), device.features());
        let cpu = info.device_type == wgpu::DeviceType::Cpu;
        let lanes_are_8 =
            features.contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size == 8 && info.subgroup_max_size == 8;
        let tier = match (cpu, lanes_are_8) {
            (true, true) if limits.max_uniform_buffer_binding_size >= UNIFORM_WINDOW => Tier::Software,
            (true, _) => Tier::Baseline,
            (false, _) => Tier::Gpu,
        };
        Self {
            tier,
            max_binding: limits.max_storage_buffer_binding_size & !255,
            max_buffer: limits.max_buffer_size,
            // 256 is WebGPU's own; a device that asks for less gains nothing from it.
            align: u64::from(
                limits.min_storage_buffer_offset_alignment.max(limits.min_uniform_buffer_offset_alignment),
            )
            .max(256),
        }
    }

    /// The same facts with another family of variants, for tests and benches.
    #[must_use]
    pub fn with_tier(mut self, tier: Tier) -> Self {
        self.tier = tier;
        self
    }

    /// How many rows of `row_bytes` (the widest of the tensors that share the rows) one dispatch may see.
    /// A multiple of 64, so that every window of f32 rows starts on a 256-byte boundary.
    pub(crate) fn rows_per_window(&self, rows: u64, row_bytes: u64) -> u64 {
        let fit = self.max_binding / row_bytes.max(1);
        if fit >= rows { rows.max(1) } else { (fit / 64 * 64).max(64) }
    }
}
