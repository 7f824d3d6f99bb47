//! Cases of `pointwise`.

use omnix_kernels::pointwise::{Binary, Operand, Pointwise, PointwiseOp, Unary, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call with or without other operands.
#[derive(Clone, Copy, Debug)]
pub struct With {
    /// The specification.
    pub spec: Pointwise,
    /// Numbers of the second operand; 0 for operations of one.
    pub b: u32,
    /// Whether the inputs are positive, as roots and logarithms want them.
    pub positive: bool,
}

impl Call for With {
    fn kernel(&self) -> &'static str {
        "pointwise"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let n = self.spec.n as usize;
        let mut rng = Rng::new(n as u64);
        let spread = if self.b == 0 { 4.0 } else { 1.0 };
        let mut a: Vec<f32> = rng.normal(n).iter().map(|v| v * spread).collect();
        if self.positive {
            a.iter_mut().for_each(|v| *v = v.abs() + 1e-3);
        }
        // Away from 0, since it may divide.
        let mut b: Vec<f32> = rng.normal(self.b.max(1) as usize).iter().map(|v| v + 0.1f32.copysign(*v)).collect();
        let mut c = Vec::new();
        match self.spec.op {
            // Numbers that are often equal.
            PointwiseOp::Binary(Binary::Equal | Binary::Less, _) => {
                a.iter_mut().chain(&mut b).for_each(|v| *v = v.round());
            }
            // Masks, and what they keep off.
            PointwiseOp::Binary(Binary::Keep | Binary::Drop, _) | PointwiseOp::Select(_) => {
                b.iter_mut().step_by(3).for_each(|v| *v = 0.0);
                c = rng.normal(n);
            }
            _ => {}
        }
        vec![Values::F32(a), Values::F32(b), Values::Out(n), Values::F32(c)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::pointwise(&self.spec, args[0].f32(), args[1].f32(), args[3].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        match self.spec.op {
            PointwiseOp::Unary(_) | PointwiseOp::Gradient(_) => 2e-6,
            PointwiseOp::Binary(Binary::Equal | Binary::Less | Binary::Keep | Binary::Drop, _)
            | PointwiseOp::Select(_) => 0.0,
            PointwiseOp::Binary(..) => 1e-6,
        }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// Whether an operation is for positive numbers alone.
fn positive(op: Unary) -> bool {
    matches!(op, Unary::Sqrt | Unary::Log) || matches!(op, Unary::Power { exponent } if exponent.fract() != 0.0)
}

/// An operation of one operand.
#[must_use]
pub fn unary(n: u32, op: Unary) -> With {
    With { spec: Pointwise::unary(n, op), b: 0, positive: positive(op) }
}

/// The gradient of an operation of one operand.
#[must_use]
pub fn gradient(n: u32, op: Unary) -> With {
    With { spec: Pointwise::gradient(n, op), b: n, positive: positive(op) }
}

/// A choice between two numbers.
#[must_use]
pub fn select(n: u32, by: Operand) -> With {
    With { spec: Pointwise::select(n, by), b: by.len, positive: false }
}

/// An operation of two.
#[must_use]
pub fn binary(n: u32, op: Binary, by: Operand) -> With {
    With { spec: Pointwise::binary(n, op, by), b: by.len, positive: false }
}

/// All operations of one number.
pub const UNARY: [Unary; 22] = [
    Unary::Relu,
    Unary::Neg,
    Unary::Abs,
    Unary::Square,
    Unary::Reciprocal,
    Unary::ScaleShift { s: 0.3, t: -2.0 },
    Unary::Clamp { low: -0.5, high: 1.5 },
    Unary::Sqrt,
    Unary::Below { limit: 0.3 },
    Unary::Gelu,
    Unary::Silu,
    Unary::Sigmoid,
    Unary::Softplus,
    Unary::Exp,
    Unary::Log,
    Unary::ExpClamped { low: -2.0, high: 1.0 },
    Unary::Tanh,
    Unary::Sign,
    Unary::IsFinite,
    Unary::Power { exponent: 3.0 },
    Unary::Power { exponent: 2.0 },
    Unary::Power { exponent: 1.5 },
];
const BINARY: [Binary; 10] = [
    Binary::Add,
    Binary::Sub,
    Binary::Mul,
    Binary::Div,
    Binary::Max,
    Binary::Min,
    Binary::Equal,
    Binary::Less,
    Binary::Keep,
    Binary::Drop,
];

/// All operations over sizes around a vector and a workgroup, by operands that repeat in every way; then cheap and costly ones
/// over maps.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for n in [1, 7, 64, 300, 4100, 4104] {
        cases.extend(UNARY.map(|op| Case::test(unary(n, op))));
        cases.extend(UNARY.map(|op| Case::test(gradient(n, op))));
    }
    for (m, c) in [(1, 1), (3, 5), (7, 4), (5, 96), (33, 12), (64, 130), (300, 28), (90, 48)] {
        let n = m * c;
        for by in [Operand::same(n), Operand::row(c), Operand::column(m, c), Operand::single()] {
            cases.extend(BINARY.map(|op| Case::test(binary(n, op, by))));
            cases.push(Case::test(select(n, by)));
        }
    }
    let (m, c) = (1 << 16, 64);
    let n = m * c;
    let benches = [
        ("scale 4M", unary(n, Unary::ScaleShift { s: 0.5, t: 1.0 })),
        ("gelu 4M", unary(n, Unary::Gelu)),
        ("exp clamped 4M", unary(n, Unary::ExpClamped { low: -10.0, high: 10.0 })),
        ("add same 4M", binary(n, Binary::Add, Operand::same(n))),
        ("mul row 65536x64", binary(n, Binary::Mul, Operand::row(c))),
        ("mul column 65536x64", binary(n, Binary::Mul, Operand::column(m, c))),
        ("gradient of relu 4M", gradient(n, Unary::Relu)),
        ("gradient of gelu 4M", gradient(n, Unary::Gelu)),
        ("keep by column 65536x64", binary(n, Binary::Keep, Operand::column(m, c))),
        ("select 4M", select(n, Operand::same(n))),
        ("scale 4M-1", unary(n - 1, Unary::ScaleShift { s: 0.5, t: 1.0 })),
    ];
    cases.extend(benches.map(|(name, call)| Case::bench(name, call)));
    cases
}
