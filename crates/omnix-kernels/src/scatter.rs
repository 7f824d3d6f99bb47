//! `y[index[r], :] = x[r, :]`: whole rows of 32-bit words to their place. Rows of y that no index names keep their
//! value; indices out of range are skipped. An index may not occur twice: there are no atomics, so which row would
//! win is not defined (the oracle asserts it).

use omnix_shaders::scatter as shaders;

use crate::cover::{cover, unit};
use crate::gather::{RowWindows, RowsParams, row_windows};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[m, c]`.
pub const X: Arg = Arg(0);
/// u32 `[m]`.
pub const INDEX: Arg = Arg(1);
/// What is written into, `[n, c]`.
pub const Y: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Scatter {
    /// Rows of y.
    pub n: u32,
    /// Rows of x.
    pub m: u32,
    /// Words of a row.
    pub c: u32,
}

impl Scatter {
    /// Bytes read and written, indices included.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        u64::from(self.m) * (8 * u64::from(self.c) + 4)
    }

    /// The dispatches that compute this on a device with `caps`; none where x or y is empty.
    ///
    /// # Errors
    /// When one row is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if self.n == 0 {
            return Ok(Vec::new());
        }
        let (shader, unit) =
            unit(caps, self.c.is_multiple_of(4), [&shaders::WORDS, &shaders::VEC4, &shaders::SOFTWARE]);
        let c = u64::from(self.c);
        let dispatch = |w: &RowWindows| {
            let (x, x_rest) = cover(X, w.first * c, w.m * c, caps);
            let (y, y_rest) = cover(Y, w.lo * c, (w.hi - w.lo) * c, caps);
            let (index, i_rest) = cover(INDEX, w.first, w.m, caps);
            let (params, groups) = RowsParams::new(w, [self.n, self.c], [x_rest, y_rest, i_rest], unit, caps);
            Dispatch::new(shader, &params, &[x, index, y], groups)
        };
        Ok(row_windows("scatter", [self.n, self.m, self.c], caps)?.iter().map(dispatch).collect())
    }
}
