//! `y[outer, inner] = op_n x[outer, n, inner]`: reduction over one axis.
//!
//! Sums run over n in order; splitting over `outer` changes no bit. With NaN among the inputs the sums are NaN, and
//! which number a maximum or minimum gives is up to the device.

use omnix_shaders::reduce as shaders;

use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[outer, n, inner]`.
pub const X: Arg = Arg(0);
/// Output `[outer, inner]`.
pub const Y: Arg = Arg(1);

/// How numbers are joined; `shaders/reduce` has the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum ReduceOp {
    /// The sum.
    Sum = 0,
    /// The sum divided by n.
    Mean = 1,
    /// The largest.
    Max = 2,
    /// The smallest.
    Min = 3,
    /// The standard deviation with divisor n − 1; 0 for n = 1.
    Std = 4,
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reduce {
    /// Product of the axes before the reduced one.
    pub outer: u32,
    /// The reduced axis.
    pub n: u32,
    /// Product of the axes after it.
    pub inner: u32,
    /// The operation.
    pub op: ReduceOp,
}

crate::layout::params! {
    /// `Params` of `shaders/reduce`.
    pub struct ReduceParams {
        outer: u32,
        n: u32,
        inner: u32,
        op: u32,
        x_skip: u32,
        y_skip: u32,
        pad0: u32,
        pad1: u32,
    }
}

/// Outputs of a workgroup.
const GROUP: u64 = 64;

impl Reduce {
    /// Bytes of x and y, once each.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.outer as u64 * self.inner as u64 * (self.n as u64 + 1)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or `n · inner` numbers are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (kernel, limit) = ("reduce", caps.max_binding);
        if self.outer == 0 || self.n == 0 || self.inner == 0 {
            let reason = format!("x is [{}, {}, {}]; no axis may be 0", self.outer, self.n, self.inner);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let outer = u64::from(self.outer);
        let y_row = u64::from(self.inner) * 4;
        let x_row = u64::from(self.n) * y_row;
        // Where rows are split, a binding starts up to one alignment step before its first row.
        let rows = if outer * x_row <= limit { outer } else { limit.saturating_sub(caps.align) / x_row };
        if rows == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: x_row + caps.align, limit });
        }
        let piece = |row0: u64| {
            let count = rows.min(outer - row0);
            let window = |arg: Arg, row: u64| {
                let start = row0 * row / caps.align * caps.align;
                (arg.window(start, (row0 + count) * row - start), ((row0 * row - start) / 4) as u32)
            };
            let ((x, x_skip), (y, y_skip)) = (window(X, x_row), window(Y, y_row));
            let (n, inner, op) = (self.n, self.inner, self.op as u32);
            let params = ReduceParams { outer: count as u32, n, inner, op, x_skip, y_skip, pad0: 0, pad1: 0 };
            Dispatch::new(&shaders::BASELINE, &params, &[x, y], (count * u64::from(inner)).div_ceil(GROUP))
        };
        Ok((0..outer).step_by(rows as usize).map(piece).collect())
    }
}
