//! Gradients of [`crate::layer_norm`] (without an activation), with n = (x − mean) / √(var + eps) and g = dy · weight:
//!
//! - `dx = (g − mean g − n · mean(g n)) / √(var + eps)`, means over the channels of a row;
//! - `dweight[c] = Σ_m dy n`, `dbias[c] = Σ_m dy`, over the rows.
//!
//! Rows leave their mean and scale in [`STATS`]; sums over rows are cut as those of [`crate::linear_weights`], so that splitting changes no
//! bit.

use omnix_shaders::layer_norm_grad as shaders;

use crate::cover::{cover, room, unit};
use crate::dispatch::{Window, round_up};
use crate::linear_weights::{PART, add, column_sections, column_words};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// The norm's input `[m, c]`.
pub const X: Arg = Arg(0);
/// `[c]`.
pub const WEIGHT: Arg = Arg(1);
/// Gradient of the norm's output `[m, c]`.
pub const DY: Arg = Arg(2);
/// Output `[m, c]`.
pub const DX: Arg = Arg(3);
/// Output `[c]`.
pub const D_WEIGHT: Arg = Arg(4);
/// Output `[c]`.
pub const D_BIAS: Arg = Arg(5);
/// Scratch `[m, 2]`.
pub const STATS: Arg = Arg(6);
/// Scratch of [`LayerNormGrad::parts_words`] numbers.
pub const PARTS: Arg = Arg(7);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerNormGrad {
    /// Rows.
    pub m: u32,
    /// Channels.
    pub c: u32,
    /// Added to the variance.
    pub eps: f32,
    /// Whether [`WEIGHT`] is there.
    pub weight: bool,
    /// Whether [`D_WEIGHT`] is there.
    pub d_weight: bool,
    /// Whether [`D_BIAS`] is there.
    pub d_bias: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/layer_norm_grad`.
    #[derive(Default)]
    pub struct LayerNormGradParams {
        m: u32,
        c: u32,
        flags: u32,
        eps: f32,
        section: u32,
        weight_rest: u32,
        bias_rest: u32,
        pad0: u32,
    }
}

const KERNEL: &str = "layer_norm_grad";
const HAS_WEIGHT: u32 = 1;
const WANTS_WEIGHT: u32 = 2;
const WANTS_BIAS: u32 = 4;
const GO_ON: u32 = 8;
/// Rows a workgroup of the software variant owns (`ROWS` in the sidecar file).
const SOFTWARE_ROWS: u64 = 4;

impl LayerNormGrad {
    /// Bytes read and written once each: x, dy and dx.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        12 * u64::from(self.m) * u64::from(self.c)
    }

    /// 32-bit words of [`PARTS`]: 0 where nothing waits there, and the argument is not bound.
    #[must_use]
    pub fn parts_words(&self) -> u64 {
        // Those of the weights, then those of the bias.
        2 * self.region()
    }

    /// Words of the sums of sections of one output.
    fn region(&self) -> u64 {
        round_up(column_words(self.m.into(), self.c.into()), 64)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When there are no rows or channels, or 64 rows are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let limit = caps.max_binding;
        if self.m == 0 || self.c == 0 {
            let reason = format!("x is [{}, {}]; it needs at least one row and one channel", self.m, self.c);
            return Err(KernelError::Unsupported { kernel: KERNEL, reason });
        }
        let (m, row_bytes) = (u64::from(self.m), u64::from(self.c) * 4);
        let rows = caps.rows_per_window(m, row_bytes);
        if rows * row_bytes > limit {
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes: rows * row_bytes, limit });
        }
        let (shader, group_rows) = match caps.tier {
            Tier::Software if self.c.is_multiple_of(8) => (&shaders::SOFTWARE, SOFTWARE_ROWS),
            Tier::Gpu => (&shaders::GPU, 1),
            _ => (&shaders::BASELINE, 64),
        };
        let mut out = Vec::new();
        for row0 in (0..m).step_by(rows as usize) {
            let count = rows.min(m - row0);
            let flags = if self.weight { HAS_WEIGHT } else { 0 };
            let params = LayerNormGradParams { m: count as u32, c: self.c, flags, eps: self.eps, ..Default::default() };
            let window = |arg: Arg| arg.window(row0 * row_bytes, count * row_bytes);
            let stats = STATS.window(row0 * 8, count * 8);
            let windows = [window(X), WEIGHT.when(self.weight).into(), window(DY), window(DX), stats];
            out.push(Dispatch::new(shader, &params, &windows, count.div_ceil(group_rows)));
        }
        if self.d_weight || self.d_bias {
            self.columns(rows, caps, &mut out)?;
        }
        Ok(out)
    }

    /// The sums over rows, at most `rows` of them a dispatch.
    fn columns(&self, rows: u64, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let (m, c) = (u64::from(self.m), u64::from(self.c));
        let sections = column_sections(m, c);
        let direct = sections.count() == 1;
        let (shader, width) =
            unit(caps, self.c.is_multiple_of(4), [&shaders::COLUMNS, &shaders::COLUMNS4, &shaders::COLUMNS_SOFTWARE]);
        let fit = if rows >= m { m.next_multiple_of(PART) } else { rows };
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        for run in sections.runs(fit, (room(caps) / c).max(1)) {
            // Where the sums of this run go.
            let target = |there: bool, arg: Arg, region: u64| -> (Window, u32) {
                match (there, direct) {
                    (false, _) => (Arg::ABSENT.into(), 0),
                    (true, true) => (arg.into(), 0),
                    (true, false) => cover(PARTS, region + run.section * c, run.sections * c, caps),
                }
            };
            let (weight, weight_rest) = target(self.d_weight, D_WEIGHT, 0);
            let (bias, bias_rest) = target(self.d_bias, D_BIAS, self.region());
            let params = LayerNormGradParams {
                m: run.rows as u32,
                c: self.c / width,
                flags: set(self.d_weight, WANTS_WEIGHT) | set(self.d_bias, WANTS_BIAS) | set(run.go_on, GO_ON),
                eps: self.eps,
                section: sections.each as u32,
                weight_rest: weight_rest / width,
                bias_rest: bias_rest / width,
                pad0: 0,
            };
            let window = |arg: Arg| arg.window(run.row0 * c * 4, run.rows * c * 4);
            let windows = [window(X), window(DY), STATS.window(run.row0 * 8, run.rows * 8), weight, bias];
            let groups = (run.sections * c / u64::from(width)).div_ceil(64);
            out.push(Dispatch::new(shader, &params, &windows, groups));
        }
        let wanted = [(self.d_weight, D_WEIGHT, 0), (self.d_bias, D_BIAS, self.region())];
        for (_, arg, region) in wanted.into_iter().filter(|(there, ..)| *there && !direct) {
            add(KERNEL, (PARTS, region, c), sections.count(), (arg, 0, c), caps, out)?;
        }
        Ok(())
    }
}
