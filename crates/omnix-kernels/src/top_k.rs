//! The k largest of each row of n numbers: their indices (within the row, or flat: plus row · n), ascending, and a mask
//! of 1 and 0.
//!
//! Ties: the lower index wins; −0 equals 0; NaN counts as lowest, below −∞. Exact and deterministic: the k-th
//! largest is found by counting over the bits of order-preserving integers (32 readings of a row by one workgroup).

use omnix_shaders::top_k as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[rows, n]`.
pub const X: Arg = Arg(0);
/// Output u32 `[rows, k]`.
pub const INDEX: Arg = Arg(1);
/// Output `[rows, n]`.
pub const MASK: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TopK {
    /// Independent rows.
    pub rows: u32,
    /// Numbers of a row.
    pub n: u32,
    /// How many are chosen, 1..=n.
    pub k: u32,
    /// Indices are plus row · n, so that rows of a `[rows · n, ..]` matrix can be gathered.
    pub flat: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/top_k`.
    pub struct TopKParams {
        rows: u32,
        n: u32,
        k: u32,
        x_rest: u32,
        i_rest: u32,
        m_rest: u32,
        flat: u32,
        row0: u32,
    }
}

impl TopK {
    /// Bytes read and written: the 34 readings of x, and the results.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.rows) * (35 * u64::from(self.n) + u64::from(self.k))
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When k is 0 or above n, there are no rows, or a row is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let Self { rows, n, k, flat } = *self;
        if rows == 0 || k == 0 || k > n {
            let reason =
                format!("the {k} largest of {rows} rows of {n}; 1 to {n} can be chosen of each of 1 or more rows");
            return Err(KernelError::Unsupported { kernel: "top_k", reason });
        }
        let (all, n, k) = (u64::from(rows), u64::from(n), u64::from(k));
        if flat && all * n > u64::from(u32::MAX) {
            let reason = format!("flat indices of {all} rows of {n} exceed 32 bits; use fewer rows");
            return Err(KernelError::Unsupported { kernel: "top_k", reason });
        }
        let fit = (room(caps) / n).min((caps.max_operations() / operations(1, n)).max(1));
        if fit == 0 {
            return Err(KernelError::RowTooLarge { kernel: "top_k", bytes: n * 4, limit: caps.max_binding });
        }
        let dispatch = |row: u64| {
            let rows = fit.min(all - row);
            let (x, x_rest) = cover(X, row * n, rows * n, caps);
            let (index, i_rest) = cover(INDEX, row * k, rows * k, caps);
            let (mask, m_rest) = cover(MASK, row * n, rows * n, caps);
            let (flat, row0) = (u32::from(flat), row as u32);
            let params = TopKParams { rows: rows as u32, n: self.n, k: self.k, x_rest, i_rest, m_rest, flat, row0 };
            Dispatch::new(&shaders::BASELINE, &params, &[x, index, mask], rows).of_operations(operations(rows, n))
        };
        Ok((0..all).step_by(fit as usize).map(dispatch).collect())
    }
}

/// Operations of rows: each of the 34 readings of a number takes about ten to order and to compare.
const fn operations(rows: u64, n: u64) -> u64 {
    rows * n * 340
}
