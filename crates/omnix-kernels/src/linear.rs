//! `y[m, n] = residual + gamma[n] · act(Σ_k x[m, k] W[k, n] + bias[n])`: every linear layer, every 1×1
//! convolution (rows are pixels), and transposed convolutions whose stride is their kernel (one column per output channel and
//! place within the kernel; a copy then moves the columns to their pixels).
//!
//! W is packed ([`PackedWeights`]); int8 columns are scaled after their sum. Sums run over k in order whatever the rows or
//! columns of a dispatch, in the tile of few columns as eight sums that are added in one order, so splitting changes no bit.

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

crate::layout::params! {
    /// `Params` of `shaders/linear`.
    pub struct LinearParams {
        m: u32,
        n: u32,
        k: u32,
        n0: u32,
        blocks: u32,
        act: u32,
        flags: u32,
        k_packed: u32,
        group: u32,
        k0: u32,
        k_len: u32,
        pad0: u32,
    }
}

const HAS_BIAS: u32 = 1;
const HAS_GAMMA: u32 = 2;
const HAS_RESIDUAL: u32 = 4;
const GO_ON: u32 = 8;
const PARTIAL: u32 = 16;

/// Columns up to which software devices compute four at a time: beyond, 32 at a time are less work.
const NARROW: u32 = 8;

/// What of y, and of the sums over k, one dispatch computes.
#[derive(Clone, Copy, Debug)]
struct Piece {
    row0: u64,
    rows: u64,
    /// Blocks of 32 columns: the first, and how many.
    block: u32,
    blocks: u32,
    k0: u32,
    k_len: u32,
}

/// How a family of variants cuts y into tiles.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// This number of rows x 32 columns per workgroup.
    Software(u64),
    /// This number of rows x 4 columns per workgroup.
    Narrow(u64),
    /// As `Software`, weights through uniform windows.
    Windows(u64),
    /// 64 x 64 per workgroup.
    Gpu,
    /// 4 x 4 per invocation.
    Baseline,
}

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
        let mut out = Vec::new();
        for row0 in (0..u64::from(self.m)).step_by(rows as usize) {
            self.columns(row0, rows.min(u64::from(self.m) - row0), caps, &mut out);
        }
        Ok(out)
    }

    /// Some rows, split by columns where the weights exceed the binding limit.
    fn columns(&self, row0: u64, m: u64, caps: &Caps, out: &mut Vec<Dispatch>) {
        let w = &self.weights;
        let fours = w.k.is_multiple_of(4) && w.n.is_multiple_of(4);
        let narrow = w.k.is_multiple_of(4) && w.n <= NARROW;
        let (shader, form) = match (caps.tier, w.storage) {
            (Tier::Software, WeightType::F32) if narrow => (&shaders::NARROW, Form::Narrow(16)),
            (Tier::Software, WeightType::F16) if narrow => (&shaders::NARROW_W16, Form::Narrow(16)),
            (Tier::Software, WeightType::I8) if narrow => (&shaders::NARROW_W8, Form::Narrow(16)),
            // Rows of a tile: TM of linear.toml.
            (Tier::Software, storage) if fours && caps.weight_windows() => {
                let shader = match storage {
                    WeightType::F32 => &shaders::WINDOWS,
                    WeightType::F16 => &shaders::WINDOWS_W16,
                    WeightType::I8 => &shaders::WINDOWS_W8,
                };
                return self.uniform_windows(shader, (row0, m), out);
            }
            (Tier::Software, WeightType::F32) if fours => (&shaders::SOFTWARE, Form::Software(40)),
            (Tier::Software, WeightType::F16) if fours => (&shaders::SOFTWARE_W16, Form::Software(40)),
            (Tier::Software, WeightType::I8) if fours => (&shaders::SOFTWARE_W8, Form::Software(40)),
            (Tier::Gpu, storage) if fours => (tile(storage, caps), Form::Gpu),
            (_, WeightType::F32) => (&shaders::BASELINE, Form::Baseline),
            (_, WeightType::F16) => (&shaders::BASELINE_W16, Form::Baseline),
            (_, WeightType::I8) => (&shaders::BASELINE_W8, Form::Baseline),
        };
        // An even number of blocks: the GPU tile is two wide, and 256-byte alignment follows.
        // The fewest rows of a dispatch are 64.
        let short = caps.max_operations() / operations(64, 1, w.k);
        let fit = (caps.max_binding / w.block_bytes()).min(short).max(2) as u32 / 2 * 2;
        for block in (0..w.blocks()).step_by(fit as usize) {
            let blocks = fit.min(w.blocks() - block);
            // Rows whose windows start aligned, as those of `record` do.
            let short = caps.max_operations() / operations(1, blocks, w.k);
            let short = (short / 64 * 64).max(64).min(m.next_multiple_of(64));
            for skip in (0..m).step_by(short as usize) {
                let (row0, rows) = (row0 + skip, short.min(m - skip));
                out.push(self.dispatch(shader, form, Piece { row0, rows, block, blocks, k0: 0, k_len: w.k }));
            }
        }
    }

    /// Some rows, one dispatch per window of weights: several column blocks where a window holds all their k, else one and part of
    /// its k. Sums that go on in the next window wait in y, and take the order they would have in one.
    fn uniform_windows(&self, shader: &'static Shader, (row0, rows): (u64, u64), out: &mut Vec<Dispatch>) {
        let w = &self.weights;
        let deep = (UNIFORM_WINDOW / WeightType::ROW_BYTES * w.storage.k_per_row()) as u32;
        let wide = (deep / w.k_packed()).clamp(1, w.blocks());
        for block in (0..w.blocks()).step_by(wide as usize) {
            for k0 in (0..w.k).step_by(deep as usize) {
                let (blocks, k_len) = (wide.min(w.blocks() - block), deep.min(w.k - k0));
                out.push(self.dispatch(shader, Form::Windows(24), Piece { row0, rows, block, blocks, k0, k_len }));
            }
        }
    }

    fn dispatch(
        &self,
        shader: &'static Shader,
        form: Form,
        Piece { row0, rows: m, block, blocks, k0, k_len }: Piece,
    ) -> Dispatch {
        let PackedWeights { k, n, storage } = self.weights;
        let columns = u64::from(blocks);
        // Workgroups, and row tiles that go by a column block before the next.
        let (groups, group) = match form {
            Form::Software(rows) | Form::Windows(rows) => {
                let tiles = m.div_ceil(rows);
                (tiles * columns, self.weights.row_group(tiles, rows * u64::from(k) * 4))
            }
            Form::Narrow(rows) => (m.div_ceil(rows) * u64::from(n).div_ceil(4), 0),
            Form::Gpu => (m.div_ceil(64) * columns.div_ceil(2), 0),
            // 64 tiles of 4 x 4 per workgroup.
            Form::Baseline => ((m.div_ceil(4) * columns * 8).div_ceil(64), 0),
        };
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let params = LinearParams {
            m: m as u32,
            n,
            k,
            n0: block * 32,
            blocks,
            act: self.act as u32,
            flags: set(self.bias, HAS_BIAS)
                | set(self.gamma, HAS_GAMMA)
                | set(self.residual, HAS_RESIDUAL)
                | set(k0 > 0, GO_ON)
                | set(k0 + k_len < k, PARTIAL),
            k_packed: self.weights.k_packed(),
            group,
            k0,
            k_len,
            pad0: 0,
        };
        let first = u64::from(block) * self.weights.block_bytes();
        let weights = match form {
            Form::Windows(_) => {
                W.window(first + u64::from(k0) / storage.k_per_row() * WeightType::ROW_BYTES, UNIFORM_WINDOW)
            }
            _ => W.window(first, columns * self.weights.block_bytes()),
        };
        let rows = |arg: Arg, width: u32| arg.window(row0 * u64::from(width) * 4, m * u64::from(width) * 4);
        let residual = if self.residual { rows(RESIDUAL, n) } else { Arg::ABSENT.into() };
        let mut windows: SmallVec<[Window; 8]> = smallvec![
            rows(X, k),
            weights,
            BIAS.when(self.bias).into(),
            GAMMA.when(self.gamma).into(),
            residual,
            rows(Y, n)
        ];
        if storage == WeightType::I8 {
            let (start, bytes) = self.weights.scales();
            windows.push(W.window(start, bytes));
        }
        Dispatch::new(shader, &params, &windows, groups).of_operations(operations(m, blocks, k_len))
    }
}

/// Operations of rows by blocks of 32 columns, padding included.
fn operations(rows: u64, blocks: u32, k_len: u32) -> u64 {
    2 * rows * 32 * u64::from(blocks) * u64::from(k_len).max(1)
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
