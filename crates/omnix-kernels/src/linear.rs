//! `y[m, n] = residual + gamma[n] · act(Σ_k x[m, k] W[k, n] + bias[n])`: every linear layer, every 1×1
//! convolution (rows are pixels) and, by way of `depth_to_space`, transposed convolutions.
//!
//! W is packed ([`PackedWeights`]); int8 columns are scaled after their sum. Sums run over k in order in every variant and whatever the rows or
//! windows of a dispatch, so splitting changes no bit.

use bytemuck::{Pod, Zeroable};
use omnix_shaders::{Shader, linear as shaders};
use smallvec::{SmallVec, smallvec};

use crate::caps::{Cooperative, UNIFORM_WINDOW};
use crate::dispatch::Window;
use crate::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType};

/// Input `[m, k]`.
pub const X: Arg = Arg(0);
/// Packed weights.
pub const W: Arg = Arg(1);
/// `[n]`.
pub const BIAS: Arg = Arg(2);
/// `[n]`.
pub const GAMMA: Arg = Arg(3);
/// `[m, n]`.
pub const RESIDUAL: Arg = Arg(4);
/// Output `[m, n]`.
pub const Y: Arg = Arg(5);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Linear {
    /// Rows.
    pub m: u32,
    /// The weights' shape; its `k` is the depth of x, its `n` the width of y.
    pub weights: PackedWeights,
    /// Applied after the bias.
    pub act: Activation,
    /// Whether [`BIAS`] is there.
    pub bias: bool,
    /// Whether [`GAMMA`] (layer scale) is there.
    pub gamma: bool,
    /// Whether [`RESIDUAL`] is there; it may not be the output's buffer.
    pub residual: bool,
}

/// `Params` of `shaders/linear`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LinearParams {
    m: u32,
    n: u32,
    k: u32,
    n0: u32,
    k0: u32,
    k_len: u32,
    blocks: u32,
    act: u32,
    flags: u32,
    k_packed: u32,
    pad0: u32,
    pad1: u32,
}

crate::layout::layout!(LinearParams { m, n, k, n0, k0, k_len, blocks, act, flags, k_packed, pad0, pad1 });

/// Rows of the software tile: TM of linear.toml.
const SOFTWARE_ROWS: u64 = 32;
const HAS_BIAS: u32 = 1;
const HAS_GAMMA: u32 = 2;
const HAS_RESIDUAL: u32 = 4;
const ACCUMULATE: u32 = 8;
const LAST: u32 = 16;

impl Linear {
    /// Multiply-adds, each counted as two operations.
    #[must_use]
    pub fn flops(&self) -> u64 {
        2 * u64::from(self.m) * u64::from(self.weights.n) * u64::from(self.weights.k)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When one row of x or y is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let PackedWeights { k, n, .. } = self.weights;
        let row_bytes = u64::from(k.max(n)) * 4;
        if row_bytes * 64 > caps.max_binding && u64::from(self.m) * row_bytes > caps.max_binding {
            return Err(KernelError::RowTooLarge { kernel: "linear", bytes: row_bytes * 64, limit: caps.max_binding });
        }
        let rows = caps.rows_per_window(u64::from(self.m), row_bytes);
        let software = caps.tier == Tier::Software && k.is_multiple_of(4) && n.is_multiple_of(4);
        let mut out = Vec::new();
        let mut row0 = 0;
        while row0 < u64::from(self.m) {
            let m = rows.min(u64::from(self.m) - row0);
            if software {
                self.uniform_windows(row0, m, &mut out);
            } else {
                self.column_windows(row0, m, caps, &mut out);
            }
            row0 += m;
        }
        Ok(out)
    }

    /// The software variant: one dispatch a window of at most 64 KiB of weights.
    fn uniform_windows(&self, row0: u64, m: u64, out: &mut Vec<Dispatch>) {
        let w = &self.weights;
        let shader = match w.storage {
            WeightType::F32 => &shaders::SOFTWARE,
            WeightType::F16 => &shaders::SOFTWARE_W16,
            WeightType::I8 => &shaders::SOFTWARE_W8,
        };
        let k_window = (UNIFORM_WINDOW / WeightType::ROW_BYTES * w.storage.k_per_row()) as u32;
        let whole_blocks = (k_window / w.k_packed()).clamp(1, w.blocks());
        let mut block = 0;
        while block < w.blocks() {
            let blocks = whole_blocks.min(w.blocks() - block);
            let mut k0 = 0;
            while k0 < w.k {
                let k_len = k_window.min(w.k - k0);
                let mut flags = if k0 > 0 { ACCUMULATE } else { 0 };
                if k0 + k_len == w.k {
                    flags |= LAST;
                }
                let offset =
                    u64::from(block) * w.block_bytes() + u64::from(k0) / w.storage.k_per_row() * WeightType::ROW_BYTES;
                let window = W.window(offset, UNIFORM_WINDOW);
                let groups = m.div_ceil(SOFTWARE_ROWS) * u64::from(blocks);
                out.push(self.dispatch(shader, row0, m, window, (block, blocks), (k0, k_len), flags, groups));
                k0 += k_len;
            }
            block += blocks;
        }
    }

    /// The other variants: weights in storage, split by columns where they exceed the binding limit.
    fn column_windows(&self, row0: u64, m: u64, caps: &Caps, out: &mut Vec<Dispatch>) {
        let w = &self.weights;
        let gpu = caps.tier == Tier::Gpu && w.k.is_multiple_of(4) && w.n.is_multiple_of(4);
        let shader = match (gpu, w.storage) {
            (true, storage) => tile(storage, caps),
            (false, WeightType::F32) => &shaders::BASELINE,
            (false, WeightType::F16) => &shaders::BASELINE_W16,
            (false, WeightType::I8) => &shaders::BASELINE_W8,
        };
        // An even number of blocks: the GPU tile is two wide, and 256-byte alignment follows.
        let fit = (caps.max_binding / w.block_bytes()).max(2) as u32 / 2 * 2;
        let mut block = 0;
        while block < w.blocks() {
            let blocks = fit.min(w.blocks() - block);
            let window = W.window(u64::from(block) * w.block_bytes(), u64::from(blocks) * w.block_bytes());
            let groups = if gpu {
                m.div_ceil(64) * u64::from(blocks.div_ceil(2))
            } else {
                (m.div_ceil(4) * u64::from(blocks) * 8).div_ceil(64)
            };
            out.push(self.dispatch(shader, row0, m, window, (block, blocks), (0, w.k), LAST, groups));
            block += blocks;
        }
    }

    #[expect(clippy::too_many_arguments, reason = "one private place that turns a window into a dispatch")]
    fn dispatch(
        &self,
        shader: &'static Shader,
        row0: u64,
        m: u64,
        window: Window,
        (block, blocks): (u32, u32),
        (k0, k_len): (u32, u32),
        flags: u32,
        groups: u64,
    ) -> Dispatch {
        let PackedWeights { k, n, .. } = self.weights;
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let params = LinearParams {
            m: m as u32,
            n,
            k,
            n0: block * 32,
            k0,
            k_len,
            blocks,
            act: self.act as u32,
            flags: flags | set(self.bias, HAS_BIAS) | set(self.gamma, HAS_GAMMA) | set(self.residual, HAS_RESIDUAL),
            k_packed: self.weights.k_packed(),
            pad0: 0,
            pad1: 0,
        };
        let rows = |arg: Arg, width: u32| arg.window(row0 * u64::from(width) * 4, m * u64::from(width) * 4);
        let residual = if self.residual { rows(RESIDUAL, n) } else { Arg::ABSENT.into() };
        let mut windows: SmallVec<[Window; 8]> = smallvec![
            rows(X, k),
            window,
            BIAS.when(self.bias).into(),
            GAMMA.when(self.gamma).into(),
            residual,
            rows(Y, n)
        ];
        if self.weights.storage == WeightType::I8 {
            let (start, bytes) = self.weights.scales();
            windows.push(W.window(start, bytes));
        }
        Dispatch::new(shader, &params, &windows, groups)
    }
}

/// The GPU variant: cooperative matrices before f16 tiles before f32 tiles. f16 operands only beside weights that are no better.
fn tile(storage: WeightType, caps: &Caps) -> &'static Shader {
    use shaders as s;
    let half = caps.f16 && storage != WeightType::F32;
    let [coop_16, coop_8, f16, plain] = match storage {
        WeightType::F32 => [&s::COOPERATIVE_8, &s::COOPERATIVE_8, &s::GPU, &s::GPU],
        WeightType::F16 => [&s::COOPERATIVE_16_W16, &s::COOPERATIVE_8_W16, &s::GPU_F16_W16, &s::GPU_W16],
        WeightType::I8 => [&s::COOPERATIVE_16_W8, &s::COOPERATIVE_8_W8, &s::GPU_F16_W8, &s::GPU_W8],
    };
    match caps.products() {
        Cooperative { f16_16: true, .. } if half => coop_16,
        Cooperative { f32_8: true, .. } => coop_8,
        _ if half => f16,
        _ => plain,
    }
}
