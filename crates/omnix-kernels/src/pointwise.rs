//! `y[i] = op(a[i], b[(i / b.div) % b.len])` over n numbers; one pipeline for all operations, on software devices one more for
//! each costly one that is used.
//!
//! The four usual forms of b over a as `[m, c]`: the same shape ([`Operand::same`]), a row `[c]`
//! ([`Operand::row`]), one number per row `[m]` ([`Operand::column`]), one number ([`Operand::single`]).

use omnix_shaders::{Shader, pointwise as shaders};

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[n]`.
pub const A: Arg = Arg(0);
/// Second operand of binary operations, `[b.len]`.
pub const B: Arg = Arg(1);
/// Output `[n]`; its buffer may not be that of an input.
pub const Y: Arg = Arg(2);

/// An operation on one number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unary {
    /// `max(a, 0)`.
    Relu,
    /// `-a`.
    Neg,
    /// `|a|`.
    Abs,
    /// `a²`.
    Square,
    /// `1 / a`.
    Reciprocal,
    /// `a · s + t`.
    ScaleShift {
        /// Factor.
        s: f32,
        /// Addend.
        t: f32,
    },
    /// `min(max(a, low), high)`.
    Clamp {
        /// Least result.
        low: f32,
        /// Greatest result.
        high: f32,
    },
    /// `√a`.
    Sqrt,
    /// 1 where `a < limit`, else 0 (NaN included).
    Below {
        /// What a is compared with.
        limit: f32,
    },
    /// The erf form, `a Φ(a)`.
    Gelu,
    /// `a / (1 + exp(-a))`.
    Silu,
    /// `1 / (1 + exp(-a))`.
    Sigmoid,
    /// `log(1 + exp(a))`, beyond 20 the identity.
    Softplus,
    /// `exp(a)`.
    Exp,
    /// Natural logarithm.
    Log,
    /// `exp(min(max(a, low), high))`.
    ExpClamped {
        /// Least exponent.
        low: f32,
        /// Greatest exponent.
        high: f32,
    },
    /// Hyperbolic tangent.
    Tanh,
}

/// An operation on two numbers, `a op b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Binary {
    /// `a + b`.
    Add = 0,
    /// `a - b`.
    Sub = 1,
    /// `a · b`.
    Mul = 2,
    /// The greater.
    Max = 3,
    /// The smaller.
    Min = 4,
    /// `a / b`.
    Div = 5,
}

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
/// The number of the first operation on one number; [`Unary::code`] has them all.
const UNARY: u32 = 6;

impl Unary {
    /// Number in the shader, and its two constants.
    fn code(self) -> (u32, f32, f32) {
        match self {
            Self::Relu => (6, 0.0, 0.0),
            Self::Neg => (7, 0.0, 0.0),
            Self::Abs => (8, 0.0, 0.0),
            Self::Square => (9, 0.0, 0.0),
            Self::ScaleShift { s, t } => (10, s, t),
            Self::Clamp { low, high } => (11, low, high),
            Self::Below { limit } => (12, limit, 0.0),
            Self::Reciprocal => (13, 0.0, 0.0),
            Self::Sqrt => (14, 0.0, 0.0),
            Self::Gelu => (15, 0.0, 0.0),
            Self::Silu => (16, 0.0, 0.0),
            Self::Sigmoid => (17, 0.0, 0.0),
            Self::Softplus => (18, 0.0, 0.0),
            Self::Exp => (19, 0.0, 0.0),
            Self::Log => (20, 0.0, 0.0),
            Self::ExpClamped { low, high } => (21, low, high),
            Self::Tanh => (22, 0.0, 0.0),
        }
    }

    /// The software variant that computes it.
    const fn software(self) -> &'static Shader {
        match self {
            Self::Reciprocal => &shaders::SOFTWARE_RECIPROCAL,
            Self::Sqrt => &shaders::SOFTWARE_SQRT,
            Self::Gelu => &shaders::SOFTWARE_GELU,
            Self::Silu => &shaders::SOFTWARE_SILU,
            Self::Sigmoid => &shaders::SOFTWARE_SIGMOID,
            Self::Softplus => &shaders::SOFTWARE_SOFTPLUS,
            Self::Exp => &shaders::SOFTWARE_EXP,
            Self::Log => &shaders::SOFTWARE_LOG,
            Self::ExpClamped { .. } => &shaders::SOFTWARE_EXP_CLAMPED,
            Self::Tanh => &shaders::SOFTWARE_TANH,
            Self::Relu
            | Self::Neg
            | Self::Abs
            | Self::Square
            | Self::ScaleShift { .. }
            | Self::Clamp { .. }
            | Self::Below { .. } => &shaders::SOFTWARE,
        }
    }
}

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

    /// Bytes read and written: a and y, and b where it has the same shape.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let b = match self.op {
            PointwiseOp::Binary(_, b) => b.len,
            PointwiseOp::Unary(_) => 0,
        };
        8 * u64::from(self.n) + 4 * u64::from(b)
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When b has no elements, its `div` is 0 or the bounds of a clamp are the wrong way round.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let unsupported = |reason: String| KernelError::Unsupported { kernel: "pointwise", reason };
        let ((op, s, t), b, software) = match self.op {
            PointwiseOp::Unary(op) => (op.code(), None, op.software()),
            PointwiseOp::Binary(op, b) => ((op as u32, 0.0, 0.0), Some(b), &shaders::SOFTWARE),
        };
        if let PointwiseOp::Unary(Unary::Clamp { low, high } | Unary::ExpClamped { low, high }) = self.op
            && (low > high || low.is_nan() || high.is_nan())
        {
            return Err(unsupported(format!("clamp to {low}..{high}: the first bound must not be above the second")));
        }
        if let Some(b) = b.filter(|b| b.div == 0 || b.len == 0) {
            return Err(unsupported(format!("{b:?}: neither may be 0")));
        }
        let b = b.unwrap_or(Operand::single());
        let same = b.div == 1 && b.len >= self.n;
        // Whether b is taken, or shared, by `unit` neighbours at a time, and whether all is a multiple of it.
        let taken = |unit: u32| b.len.is_multiple_of(unit) && b.div == 1;
        let fits = |unit: u32| {
            let shared = b.div.is_multiple_of(unit) || b.len == 1;
            self.n.is_multiple_of(unit) && (op >= UNARY || taken(unit) || shared)
        };
        // A loop costs a software device less than an invocation; a GPU wants many invocations.
        let looped = if caps.tier == Tier::Gpu { 1 } else { 8 };
        let (shader, lanes, unit, steps) = match caps.tier {
            Tier::Software if fits(8) => (software, 8, 8, 32),
            _ if fits(4) => (&shaders::VEC4, 64, 4, looped),
            _ => (&shaders::WORDS, 64, 1, looped),
        };
        let b_mode = match () {
            () if op >= UNARY => B_NONE,
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
                    let (window, before) = cover(B, first, len, caps);
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
            out.push(Dispatch::new(shader, &params, &[a_window, b4, b1, y_window], groups));
            first += len;
        }
        Ok(out)
    }
}
