//! `y[r, :] = x[index[r], :]`: whole rows of 32-bit words by index; rows whose index is out of range are zero.

use omnix_shaders::gather as shaders;

use crate::cover::{cover, room, steps, unit};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[n, c]`.
pub const X: Arg = Arg(0);
/// u32 `[m]`.
pub const INDEX: Arg = Arg(1);
/// Output `[m, c]`.
pub const Y: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Gather {
    /// Rows of x.
    pub n: u32,
    /// Rows of y.
    pub m: u32,
    /// Words of a row.
    pub c: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/gather` and `shaders/scatter`.
    pub struct RowsParams {
        m: u32,
        c: u32,
        pieces: u32,
        steps: u32,
        lo: u32,
        hi: u32,
        n: u32,
        x_rest: u32,
        y_rest: u32,
        i_rest: u32,
        fill: u32,
        pad0: u32,
    }
}

/// A window over the indexed tensor and one over the rows in order.
pub(crate) struct RowWindows {
    /// Rows of the indexed tensor.
    pub(crate) lo: u64,
    pub(crate) hi: u64,
    /// Rows in order.
    pub(crate) first: u64,
    pub(crate) m: u64,
}

/// Every pair of windows of `n` indexed and `m` ordered rows of `c` words.
pub(crate) fn row_windows(
    kernel: &'static str,
    [n, m, c]: [u32; 3],
    caps: &Caps,
) -> Result<Vec<RowWindows>, KernelError> {
    let rows = (room(caps) / u64::from(c.max(1))).min(room(caps)) as usize;
    if rows == 0 {
        return Err(KernelError::RowTooLarge { kernel, bytes: u64::from(c) * 4, limit: caps.max_binding });
    }
    let (n, m) = (u64::from(n), u64::from(m));
    if c == 0 {
        return Ok(Vec::new());
    }
    let ordered = |lo: u64| {
        (0..m).step_by(rows).map(move |first| RowWindows {
            lo,
            hi: n.min(lo + rows as u64),
            first,
            m: (m - first).min(rows as u64),
        })
    };
    Ok((0..n.max(1)).step_by(rows).flat_map(ordered).collect())
}

impl RowsParams {
    /// Parameters in units of `unit` words, and the number of workgroups.
    pub(crate) fn new(windows: &RowWindows, [n, c]: [u32; 2], rests: [u32; 3], unit: u32, caps: &Caps) -> (Self, u64) {
        let (c, [x_rest, y_rest, i_rest]) = (c / unit, rests);
        let steps = steps(caps, c);
        let pieces = c.div_ceil(8 * steps);
        let params = Self {
            m: windows.m as u32,
            c,
            pieces,
            steps,
            lo: windows.lo as u32,
            hi: windows.hi as u32,
            n,
            x_rest: x_rest / unit,
            y_rest: y_rest / unit,
            i_rest,
            // Out-of-range rows are written once, by the first window.
            fill: u32::from(windows.lo == 0),
            pad0: 0,
        };
        (params, (windows.m * u64::from(pieces)).div_ceil(8))
    }
}

impl Gather {
    /// Bytes read and written, indices included.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        u64::from(self.m) * (8 * u64::from(self.c) + 4)
    }

    /// The dispatches that compute this on a device with `caps`; none where y is empty.
    ///
    /// # Errors
    /// When x has no rows, or one row is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if self.n == 0 && self.m > 0 {
            let reason = format!("{} rows out of none", self.m);
            return Err(KernelError::Unsupported { kernel: "gather", reason });
        }
        let (shader, unit) =
            unit(caps, self.c.is_multiple_of(4), [&shaders::WORDS, &shaders::VEC4, &shaders::SOFTWARE]);
        let c = u64::from(self.c);
        let dispatch = |w: &RowWindows| {
            let (x, x_rest) = cover(X, w.lo * c, (w.hi - w.lo) * c, caps);
            let (y, y_rest) = cover(Y, w.first * c, w.m * c, caps);
            let (index, i_rest) = cover(INDEX, w.first, w.m, caps);
            let (params, groups) = RowsParams::new(w, [self.n, self.c], [x_rest, y_rest, i_rest], unit, caps);
            Dispatch::new(shader, &params, &[x, index, y], groups)
        };
        Ok(row_windows("gather", [self.n, self.m, self.c], caps)?.iter().map(dispatch).collect())
    }
}
