//! What a device offers, as facts, and the tier of kernel variants that follows from them. Plain data: `device/facts.rs` reads them
//! from a device.

use std::fmt;

use crate::dispatch::MAX_OPERATIONS;

/// Which family of kernel variants suits a device. A kernel that has no variant of a tier uses its
/// baseline one, which runs everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Tier {
    /// A software rasteriser with subgroups of exactly 8 lanes and 64-bit integers (lavapipe): register tiles, constant
    /// shuffles, keys and values through uniform windows, four floats as two words, no barriers.
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
    /// Whether GPU kernels may round operands to f16: the device computes with f16, and the run allows it (a plan whose
    /// weights are f32 clears this). Sums are f32 either way.
    pub f16: bool,
    /// Fewest and most lanes of a subgroup, where shaders may use subgroups.
    pub subgroup: Option<[u32; 2]>,
    /// Cooperative matrix products, where the host opted in ([`Caps::with_cooperative`]).
    pub cooperative: Cooperative,
    /// Vector registers of the processor, where it runs the shaders (lavapipe): 16, or 32 with AVX-512.
    pub vector_registers: u32,
    /// Most invocations of a workgroup.
    pub invocations: u32,
    /// Bytes of workgroup memory.
    pub workgroup_bytes: u32,
}

/// The cooperative matrix products that kernels have variants for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Cooperative {
    /// 16×16×16, operands f16, sums f32.
    pub f16_16: bool,
    /// 8×8×8, all f32.
    pub f32_8: bool,
}

impl Cooperative {
    /// What of a device's list kernels can use; the list is [`wgpu::Adapter::cooperative_matrix_properties`].
    #[must_use]
    pub fn of(list: &[wgpu::CooperativeMatrixProperties]) -> Self {
        use wgpu::CooperativeScalarType::{F16, F32};
        let has = |size: u32, operands| {
            list.iter()
                .any(|p| [p.m_size, p.n_size, p.k_size] == [size; 3] && p.ab_type == operands && p.cr_type == F32)
        };
        Self { f16_16: has(16, F16), f32_8: has(8, F32) }
    }

    /// Whether there is any product that kernels can use.
    #[must_use]
    pub fn any(self) -> bool {
        self != Self::default()
    }
}

/// Bytes of a uniform window: WebGPU's `maxUniformBufferBindingSize`.
pub const UNIFORM_WINDOW: u64 = 65_536;

impl Caps {
    /// WebGPU's default limits: what every device has.
    #[must_use]
    pub fn baseline() -> Self {
        let limits = wgpu::Limits::default();
        Self {
            tier: Tier::Baseline,
            max_binding: 128 << 20,
            max_buffer: 256 << 20,
            align: 256,
            f16: false,
            subgroup: None,
            cooperative: Cooperative::default(),
            vector_registers: 32,
            invocations: limits.max_compute_invocations_per_workgroup,
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
        }
    }

    /// Mesa's lavapipe on a processor with AVX-512, for plans made without a device.
    #[must_use]
    pub fn lavapipe() -> Self {
        Self {
            tier: Tier::Software,
            max_buffer: (2 << 30) - 1,
            f16: true,
            subgroup: Some([8, 8]),
            invocations: 1024,
            workgroup_bytes: 32_768,
            ..Self::baseline()
        }
    }

    /// The same facts with another family of variants, for tests and benches.
    #[must_use]
    pub fn with_tier(mut self, tier: Tier) -> Self {
        self.tier = tier;
        self
    }

    /// The same facts for a processor with this number of vector registers.
    #[must_use]
    pub fn with_vector_registers(mut self, registers: u32) -> Self {
        self.vector_registers = registers;
        self
    }

    /// Whether weights of products come through uniform windows ([`UNIFORM_WINDOW`]), so that their buffers need that usage and a
    /// window's bytes behind the last of them.
    #[must_use]
    pub fn weight_windows(&self) -> bool {
        self.tier == Tier::Software && self.vector_registers < 32
    }

    /// The same facts, with f16 operands or without.
    #[must_use]
    pub fn with_f16(mut self, f16: bool) -> Self {
        self.f16 = f16;
        self
    }

    /// The same facts with other subgroups, or none.
    #[must_use]
    pub fn with_subgroup(mut self, lanes: Option<[u32; 2]>) -> Self {
        self.subgroup = lanes;
        self
    }

    /// The same facts with cooperative matrix products. wgpu has them as an experiment that a host must ask for:
    /// [`crate::adapter::open_experimental`] opens a device so and says what belongs here.
    #[must_use]
    pub fn with_cooperative(mut self, cooperative: Cooperative) -> Self {
        self.cooperative = cooperative;
        self
    }

    /// The cooperative products that shaders may use: they need to know their subgroup.
    pub(crate) fn products(&self) -> Cooperative {
        if self.subgroup.is_some() { self.cooperative } else { Cooperative::default() }
    }

    /// Whether four neighbouring lanes always share a subgroup: any width but one of less than four lanes.
    pub(crate) fn has_quads(&self) -> bool {
        self.subgroup.is_some_and(|[fewest, _]| fewest >= 4)
    }

    /// Most bytes of a tensor that one dispatch sees: the device's limit, or what a slow GPU moves in a twentieth of a second.
    pub(crate) fn window(&self) -> u64 {
        self.max_binding.min(1 << 30)
    }

    /// Most operations of one dispatch: see [`MAX_OPERATIONS`].
    pub(crate) fn max_operations(&self) -> u64 {
        if self.tier == Tier::Software { u64::MAX } else { MAX_OPERATIONS }
    }

    /// How many rows of `row_bytes` (the widest of the tensors that share the rows) one dispatch may see.
    /// A multiple of 64, so that every window of f32 rows starts on a 256-byte boundary.
    pub(crate) fn rows_per_window(&self, rows: u64, row_bytes: u64) -> u64 {
        let fit = self.window() / row_bytes.max(1);
        if fit >= rows { rows.max(1) } else { (fit / 64 * 64).max(64) }
    }
}

#[cfg(test)]
mod tests {
    use wgpu::CooperativeScalarType::{F16, F32, I32};

    use super::Cooperative;

    #[test]
    fn only_products_that_kernels_have_count() {
        let list = |m: u32, k: u32, ab, cr| wgpu::CooperativeMatrixProperties {
            m_size: m,
            n_size: 16,
            k_size: k,
            ab_type: ab,
            cr_type: cr,
            saturating_accumulation: false,
        };
        assert_eq!(Cooperative::of(&[]), Cooperative::default());
        let others = [list(16, 8, F16, F32), list(16, 16, F16, F16), list(16, 16, I32, I32), list(8, 8, F32, F32)];
        assert_eq!(Cooperative::of(&others), Cooperative::default());
        assert!(Cooperative::of(&[others[0], list(16, 16, F16, F32)]).f16_16);
    }
}
