//! `y[i] = op(a[i], b[(i / b.div) % b.len])` over n numbers: one pipeline for all plain operations, one for those that losses add
//! and one for gradients; on software devices one more for each costly operation that is used.
//!
//! A gradient is `y[i] = b[i] · op'(a[i])`: a what went into the operation, b the gradient of what came out. The choice between two
//! numbers is `y[i] = a[i]` where b is not 0 (NaN is not 0), else `c[i]`, whatever the other one is.
//!
//! The four usual forms of b over a as `[m, c]`: the same shape ([`Operand::same`]), a row `[c]`
//! ([`Operand::row`]), one number per row `[m]` ([`Operand::column`]), one number ([`Operand::single`]).

mod operation;

pub use operation::{Binary, Unary};

use self::operation::{Code, Family, SELECT, UNARY};
use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[n]`.
pub const A: Arg = Arg(0);
/// Second operand of binary operations, `[b.len]`; of gradients that of the result, `[n]`; of a choice the mask, `[b.len]`.
pub const B: Arg = Arg(1);
/// Output `[n]`; its buffer may not be that of an input.
pub const Y: Arg = Arg(2);
/// What a choice takes where the mask is 0, `[n]`.
pub const C: Arg = Arg(3);

/// Which element of b belongs to element i of a: `(i / div) % len`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Operand {
    /// How many neighbours in a share an element of b; not 0.
    pub div: u32,
    /// Elements of b; not 0.
    pub len: u32,
}

impl Operand {
    /// b has the n elements of a.
    #[must_use]
    pub const fn same(n: u32) -> Self {
        Self { div: 1, len: n }
    }

    /// b is a row of c elements, added to every row of a.
    #[must_use]
    pub const fn row(c: u32) -> Self {
        Self { div: 1, len: c }
    }

    /// b has one element for each of the m rows, c wide, of a.
    #[must_use]
    pub const fn column(m: u32, c: u32) -> Self {
        Self { div: c, len: m }
    }

    /// b is one number.
    #[must_use]
    pub const fn single() -> Self {
        Self { div: 1, len: 1 }
    }
}

/// The operation with its second operand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointwiseOp {
    /// Of a alone.
    Unary(Unary),
    /// Of a and b.
    Binary(Binary, Operand),
    /// The derivative of an operation at a, times b.
    Gradient(Unary),
    /// a where b is not 0, else c.
    Select(Operand),
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointwise {
    /// Elements of a and y.
    pub n: u32,
    /// The operation.
    pub op: PointwiseOp,
}

crate::layout::params! {
    /// `Params` of `shaders/pointwise`.
    pub struct PointwiseParams {
        n: u32,
        op: u32,
        b_mode: u32,
        b_div: u32,
        b_len: u32,
        first: u32,
        b_first: u32,
        rest: u32,
        s: f32,
        t: f32,
        steps: u32,
        pad0: u32,
    }
}

const B_NONE: u32 = 0;
const B_SAME: u32 = 1;
const B_GENERAL: u32 = 2;
const B_SHARED: u32 = 3;

impl Pointwise {
    /// `y = op(a)` over n numbers.
    #[must_use]
    pub const fn unary(n: u32, op: Unary) -> Self {
        Self { n, op: PointwiseOp::Unary(op) }
    }

    /// `y = a op b` over n numbers.
    #[must_use]
    pub const fn binary(n: u32, op: Binary, b: Operand) -> Self {
        Self { n, op: PointwiseOp::Binary(op, b) }
    }

    /// `y = b · op'(a)` over n numbers.
    #[must_use]
    pub const fn gradient(n: u32, op: Unary) -> Self {
        Self { n, op: PointwiseOp::Gradient(op) }
    }

    /// `y = a` where b is not 0, else c, over n numbers.
    #[must_use]
    pub const fn select(n: u32, b: Operand) -> Self {
        Self { n, op: PointwiseOp::Select(b) }
    }

    /// Bytes read and written: a and y, and b and c where there are any.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let others = match self.op {
            PointwiseOp::Binary(_, b) => u64::from(b.len),
            PointwiseOp::Unary(_) => 0,
            PointwiseOp::Gradient(_) => u64::from(self.n),
            PointwiseOp::Select(b) => u64::from(b.len) + u64::from(self.n),
        };
        8 * u64::from(self.n) + 4 * others
    }

    /// How shaders know the operation, and its second operand.
    const fn code(&self) -> (Code, Option<Operand>) {
        match self.op {
            PointwiseOp::Unary(op) => (op.code(), None),
            PointwiseOp::Binary(op, b) => (op.code(), Some(b)),
            PointwiseOp::Gradient(op) => (op.gradient(), Some(Operand::same(self.n))),
            PointwiseOp::Select(b) => (SELECT, Some(b)),
        }
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When b has no elements, its `div` is 0 or the bounds of a clamp are the wrong way round.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let unsupported = |reason: String| KernelError::Unsupported { kernel: "pointwise", reason };
        let (Code { family, number: op, s, t, software }, b) = self.code();
        if let PointwiseOp::Unary(unary) | PointwiseOp::Gradient(unary) = self.op
            && let Unary::Clamp { low, high } | Unary::ExpClamped { low, high } = unary
            && (low > high || low.is_nan() || high.is_nan())
        {
            return Err(unsupported(format!("clamp to {low}..{high}: the first bound must not be above the second")));
        }
        if let Some(b) = b.filter(|b| self.n > 0 && (b.div == 0 || b.len == 0)) {
            return Err(unsupported(format!("{b:?}: neither may be 0")));
        }
        // The texts of other families read two operands always: those of one number have a twice.
        let alone = family == Family::Plain && op >= UNARY;
        let b_arg = if b.is_none() { A } else { B };
        let b = b.unwrap_or(if alone { Operand::single() } else { Operand::same(self.n) });
        let same = b.div == 1 && b.len >= self.n;
        // Whether b is taken, or shared, by `unit` neighbours at a time, and whether all is a multiple of it.
        let taken = |unit: u32| b.len.is_multiple_of(unit) && b.div == 1;
        let fits = |unit: u32| {
            let shared = b.div.is_multiple_of(unit) || b.len == 1;
            self.n.is_multiple_of(unit) && (alone || taken(unit) || shared)
        };
        // A loop costs a software device less than an invocation; a GPU wants many invocations.
        let looped = if caps.tier == Tier::Gpu { 1 } else { 8 };
        let (shader, lanes, unit, steps) = match caps.tier {
            Tier::Software if fits(8) => (software, 8, 8, 32),
            _ if fits(4) => (family.shaders()[1], 64, 4, looped),
            _ => (family.shaders()[0], 64, 1, looped),
        };
        let b_mode = match () {
            () if alone => B_NONE,
            () if same => B_SAME,
            () if unit > 1 && !taken(unit) => B_SHARED,
            () => B_GENERAL,
        };
        let (n, room) = (u64::from(self.n), room(caps) / 64 * 64);
        // A period of b's repetition, where b has to be seen piece by piece.
        let period = if u64::from(b.len) > room { u64::from(b.len) * u64::from(b.div) } else { u64::MAX };
        let mut out = Vec::new();
        let mut first = 0;
        while first < n {
            let len = room.min(n - first).min(period - first % period);
            let (a_window, rest) = cover(A, first, len, caps);
            let (y_window, _) = cover(Y, first, len, caps);
            let (b_window, b_first) = match b_mode {
                B_NONE => (Arg::ABSENT.into(), 0),
                B_SAME => {
                    let (window, before) = cover(b_arg, first, len, caps);
                    (window, first as u32 - before)
                }
                _ if period < u64::MAX => {
                    let (from, to) = (first % period / u64::from(b.div), (first + len - 1) % period / u64::from(b.div));
                    let (window, before) = cover(B, from, to - from + 1, caps);
                    (window, from as u32 - before)
                }
                _ => (B.window(0, u64::from(b.len) * 4), 0),
            };
            let params = PointwiseParams {
                n: len as u32,
                op,
                b_mode,
                b_div: b.div,
                b_len: b.len,
                first: first as u32,
                b_first,
                rest,
                s,
                t,
                steps: steps as u32,
                pad0: 0,
            };
            let by_unit = if unit > 1 { matches!(b_mode, B_SAME | B_GENERAL) } else { b_mode == B_SAME };
            let absent = Arg::ABSENT.into();
            let (b4, b1) = if by_unit { (b_window, absent) } else { (absent, b_window) };
            let groups = len.div_ceil(u64::from(unit.max(4)) * lanes * steps);
            let dispatch = if family == Family::Select {
                let (c_window, _) = cover(C, first, len, caps);
                Dispatch::new(shader, &params, &[a_window, b4, b1, y_window, c_window], groups)
            } else {
                Dispatch::new(shader, &params, &[a_window, b4, b1, y_window], groups)
            };
            out.push(dispatch);
            first += len;
        }
        Ok(out)
    }
}
