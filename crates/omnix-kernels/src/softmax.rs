//! `y[m, n] = exp(x[m, n] − max_m) / Σ_n exp(x[m, n] − max_m)`: softmax over the last axis.
//!
//! A row of −∞ alone gives zeros. +∞ or NaN in a row give NaN in that row only. Sums run over n in order:
//! splitting over rows changes no bit. (`attention` has its own, online, and does not need this.)

use omnix_shaders::softmax as shaders;

use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[m, n]`.
pub const X: Arg = Arg(0);
/// Output `[m, n]`.
pub const Y: Arg = Arg(1);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Softmax {
    /// Rows.
    pub m: u32,
    /// Numbers of a row.
    pub n: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/softmax`.
    pub struct SoftmaxParams {
        m: u32,
        n: u32,
        pad0: u32,
        pad1: u32,
    }
}

/// Rows of a workgroup.
const GROUP_ROWS: u64 = 64;

impl Softmax {
    /// Bytes of x and y, once each.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        8 * self.m as u64 * self.n as u64
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or 64 rows are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (kernel, limit) = ("softmax", caps.max_binding);
        if self.m == 0 || self.n == 0 {
            let reason = format!("x is [{}, {}]; it needs at least one row and one column", self.m, self.n);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (m, row_bytes) = (u64::from(self.m), u64::from(self.n) * 4);
        let rows = caps.rows_per_window(m, row_bytes);
        if rows * row_bytes > limit {
            return Err(KernelError::RowTooLarge { kernel, bytes: rows * row_bytes, limit });
        }
        let piece = |row0: u64| {
            let count = rows.min(m - row0);
            let params = SoftmaxParams { m: count as u32, n: self.n, pad0: 0, pad1: 0 };
            let window = |arg: Arg| arg.window(row0 * row_bytes, count * row_bytes);
            Dispatch::new(&shaders::BASELINE, &params, &[window(X), window(Y)], count.div_ceil(GROUP_ROWS))
        };
        Ok((0..m).step_by(rows as usize).map(piece).collect())
    }
}
