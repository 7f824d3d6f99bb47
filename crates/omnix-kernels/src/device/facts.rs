//! The facts of an opened device, which decide the kernels' variants.

use crate::caps::{Caps, Cooperative, Tier, UNIFORM_WINDOW};

impl Caps {
    /// The facts of `device` as it was opened (features and limits not requested do not count).
    #[must_use]
    pub fn of(device: &wgpu::Device) -> Self {
        let (info, limits, features) = (device.adapter_info(), device.limits(), device.features());
        let cpu = info.device_type == wgpu::DeviceType::Cpu;
        let subgroup =
            features.contains(wgpu::Features::SUBGROUP).then_some([info.subgroup_min_size, info.subgroup_max_size]);
        let wide = features.contains(wgpu::Features::SHADER_INT64);
        let tier = match (cpu, subgroup == Some([8, 8])) {
            (true, true) if wide && limits.max_uniform_buffer_binding_size >= UNIFORM_WINDOW => Tier::Software,
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
            f16: features.contains(wgpu::Features::SHADER_F16),
            subgroup,
            cooperative: Cooperative::default(),
            vector_registers: vector_registers(),
            invocations: limits.max_compute_invocations_per_workgroup,
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
        }
    }
}

/// The number of vector registers of this processor.
fn vector_registers() -> u32 {
    #[cfg(target_arch = "x86_64")]
    if !std::arch::is_x86_feature_detected!("avx512vl") {
        return 16;
    }
    32
}
