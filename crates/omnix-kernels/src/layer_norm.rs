//! `y[m, c] = act((x[m, c] − mean_m) / √(var_m + eps) · weight[c] + bias[c])`, mean and variance (divisor c)
//! over the channels of a row.
//!
//! The sum of squares is of differences from a mean, so a large common offset costs no precision. The order of summation within a
//! row depends on the variant and on c alone: splitting over rows changes no bit.

use omnix_shaders::layer_norm as shaders;

use crate::{Activation, Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[m, c]`.
pub const X: Arg = Arg(0);
/// `[c]`.
pub const WEIGHT: Arg = Arg(1);
/// `[c]`.
pub const BIAS: Arg = Arg(2);
/// Output `[m, c]`.
pub const Y: Arg = Arg(3);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerNorm {
    /// Rows.
    pub m: u32,
    /// Channels.
    pub c: u32,
    /// Added to the variance.
    pub eps: f32,
    /// Applied after the bias.
    pub act: Activation,
    /// Whether [`WEIGHT`] is there.
    pub weight: bool,
    /// Whether [`BIAS`] is there.
    pub bias: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/layer_norm`.
    pub struct LayerNormParams {
        m: u32,
        c: u32,
        act: u32,
        flags: u32,
        eps: f32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

const HAS_WEIGHT: u32 = 1;
const HAS_BIAS: u32 = 2;
/// Rows a workgroup of the software variant owns (`ROWS` in the sidecar file).
const SOFTWARE_ROWS: u64 = 4;
/// Channels that 64 invocations of the subgroup variant hold in registers.
const SUBGROUP_CHANNELS: u32 = 64 * 4 * 8;
/// Rows a workgroup of the baseline variant owns.
const BASELINE_ROWS: u64 = 64;

impl LayerNorm {
    /// Bytes read and written once each: x and y.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        8 * u64::from(self.m) * u64::from(self.c)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When there are no rows or channels, or 64 rows are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (kernel, limit) = ("layer_norm", caps.max_binding);
        if self.m == 0 || self.c == 0 {
            let reason = format!("x is [{}, {}]; it needs at least one row and one channel", self.m, self.c);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let row_bytes = u64::from(self.c) * 4;
        let m = u64::from(self.m);
        let rows = caps.rows_per_window(m, row_bytes);
        if rows * row_bytes > limit {
            return Err(KernelError::RowTooLarge { kernel, bytes: rows * row_bytes, limit });
        }
        let (shader, group_rows) = match caps.tier {
            Tier::Software if self.c.is_multiple_of(8) && self.act == Activation::None => {
                (&shaders::SOFTWARE, SOFTWARE_ROWS)
            }
            Tier::Software if self.c.is_multiple_of(8) => (&shaders::SOFTWARE_ACT, SOFTWARE_ROWS),
            Tier::Gpu if caps.subgroup.is_some() && self.c.is_multiple_of(4) && self.c <= SUBGROUP_CHANNELS => {
                (&shaders::SUBGROUP, 1)
            }
            Tier::Gpu => (&shaders::GPU, 1),
            _ => (&shaders::BASELINE, BASELINE_ROWS),
        };
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let mut out = Vec::new();
        for row0 in (0..m).step_by(rows as usize) {
            let count = rows.min(m - row0);
            let params = LayerNormParams {
                m: count as u32,
                c: self.c,
                act: self.act as u32,
                flags: set(self.weight, HAS_WEIGHT) | set(self.bias, HAS_BIAS),
                eps: self.eps,
                pad0: 0,
                pad1: 0,
                pad2: 0,
            };
            let window = |arg: Arg| arg.window(row0 * row_bytes, count * row_bytes);
            let windows = [window(X), WEIGHT.when(self.weight).into(), BIAS.when(self.bias).into(), window(Y)];
            out.push(Dispatch::new(shader, &params, &windows, count.div_ceil(group_rows)));
        }
        Ok(out)
    }
}
