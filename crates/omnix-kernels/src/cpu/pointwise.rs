//! Oracle of `pointwise`.

use crate::activation::Activation;
use crate::pointwise::{Binary, Pointwise, PointwiseOp, Unary};

/// One number through a unary operation, in f64.
#[must_use]
pub fn unary(op: Unary, a: f64) -> f64 {
    match op {
        Unary::Relu => a.max(0.0),
        Unary::Neg => -a,
        Unary::Abs => a.abs(),
        Unary::Square => a * a,
        Unary::Reciprocal => 1.0 / a,
        Unary::ScaleShift { s, t } => a * f64::from(s) + f64::from(t),
        Unary::Clamp { low, high } => a.max(low.into()).min(high.into()),
        Unary::Sqrt => a.sqrt(),
        Unary::Below { limit } => f64::from(a < f64::from(limit)),
        Unary::Gelu => Activation::Gelu.apply(a),
        Unary::Silu => Activation::Silu.apply(a),
        Unary::Sigmoid => 1.0 / (1.0 + (-a).exp()),
        Unary::Softplus if a > 20.0 => a,
        Unary::Softplus => a.exp().ln_1p(),
        Unary::Exp => a.exp(),
        Unary::Log => a.ln(),
        Unary::ExpClamped { low, high } => a.max(low.into()).min(high.into()).exp(),
        Unary::Tanh => a.tanh(),
    }
}

/// `y[i] = op(a[i], b[(i / div) % len])`; `b` is not read by unary operations.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn pointwise(spec: &Pointwise, a: &[f32], b: &[f32]) -> Vec<f32> {
    let binary = |op: Binary, a: f64, b: f64| match op {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Max => a.max(b),
        Binary::Min => a.min(b),
    };
    (0..spec.n as usize)
        .map(|i| {
            let value = f64::from(a[i]);
            let result = match spec.op {
                PointwiseOp::Unary(op) => unary(op, value),
                PointwiseOp::Binary(op, by) => binary(op, value, f64::from(b[i / by.div as usize % by.len as usize])),
            };
            result as f32
        })
        .collect()
}
