//! Oracle of `pointwise`.

use crate::activation::{Activation, erf};
use crate::pointwise::{Binary, Operand, Pointwise, PointwiseOp, Unary};

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
        Unary::Sign if a > 0.0 => 1.0,
        Unary::Sign if a < 0.0 => -1.0,
        Unary::Sign => 0.0,
        Unary::IsFinite => f64::from(a.is_finite()),
        Unary::Power { exponent } => a.powf(exponent.into()),
    }
}

/// The derivative of [`unary`] at a, in f64; at a corner as `shaders/lib/pointwise_gradient.wgsl` says.
#[must_use]
pub fn unary_slope(op: Unary, a: f64) -> f64 {
    let logistic = |a: f64| 1.0 / (1.0 + (-a).exp());
    let inside = |low: f32, high: f32| f64::from(low) <= a && a <= f64::from(high);
    match op {
        Unary::Relu => f64::from(a > 0.0),
        Unary::Neg => -1.0,
        Unary::Abs => unary(Unary::Sign, a),
        Unary::Square => 2.0 * a,
        Unary::Reciprocal => -1.0 / (a * a),
        Unary::ScaleShift { s, .. } => s.into(),
        Unary::Clamp { low, high } => f64::from(inside(low, high)),
        Unary::Sqrt => 0.5 / a.sqrt(),
        Unary::Below { .. } | Unary::Sign | Unary::IsFinite => 0.0,
        Unary::Gelu => {
            let density = (-0.5 * a * a).exp() / (2.0 * std::f64::consts::PI).sqrt();
            0.5 * (1.0 + erf(a / std::f64::consts::SQRT_2)) + a * density
        }
        Unary::Silu => logistic(a) * (1.0 + a * (1.0 - logistic(a))),
        Unary::Sigmoid => logistic(a) * (1.0 - logistic(a)),
        Unary::Softplus => logistic(a),
        Unary::Exp => a.exp(),
        Unary::Log => 1.0 / a,
        Unary::ExpClamped { low, high } => {
            if inside(low, high) {
                a.exp()
            } else {
                0.0
            }
        }
        Unary::Tanh => 1.0 - a.tanh() * a.tanh(),
        // Also at 0, where its power of -1 is infinite.
        Unary::Power { exponent: 0.0 } => 0.0,
        Unary::Power { exponent } => f64::from(exponent) * a.powf(f64::from(exponent) - 1.0),
    }
}

/// `y[i] = op(a[i], b[(i / div) % len])`, a derivative times b or a choice between a and c; what an operation does not have is not read.
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn pointwise(spec: &Pointwise, a: &[f32], b: &[f32], c: &[f32]) -> Vec<f32> {
    let binary = |op: Binary, a: f64, b: f64| match op {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Max => a.max(b),
        Binary::Min => a.min(b),
        Binary::Equal => f64::from(a == b),
        Binary::Less => f64::from(a < b),
        Binary::Keep if b == 0.0 => 0.0,
        Binary::Keep => a,
        Binary::Drop if b == 0.0 => a,
        Binary::Drop => 0.0,
    };
    let of = |by: Operand, i: usize| f64::from(b[i / by.div as usize % by.len as usize]);
    (0..spec.n as usize)
        .map(|i| {
            let value = f64::from(a[i]);
            let result = match spec.op {
                PointwiseOp::Unary(op) => unary(op, value),
                PointwiseOp::Binary(op, by) => binary(op, value, of(by, i)),
                PointwiseOp::Gradient(op) => unary_slope(op, value) * f64::from(b[i]),
                PointwiseOp::Select(by) if of(by, i) == 0.0 => c[i].into(),
                PointwiseOp::Select(_) => value,
            };
            result as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{unary, unary_slope};
    use crate::pointwise::Unary;

    #[test]
    fn slopes_are_those_of_central_differences() {
        for op in [
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
            Unary::Power { exponent: -2.0 },
            Unary::Power { exponent: 1.5 },
        ] {
            let fractional = matches!(op, Unary::Power { exponent } if exponent.fract() != 0.0);
            let positive = fractional || matches!(op, Unary::Sqrt | Unary::Log);
            for a in [-3.1, -1.2, -0.4, 0.2, 0.7, 1.9, 3.3].into_iter().filter(|a| !positive || *a > 0.0) {
                let step = 1e-6;
                let difference = (unary(op, a + step) - unary(op, a - step)) / (2.0 * step);
                let slope = unary_slope(op, a);
                assert!(
                    (difference - slope).abs() <= 1e-7 * (1.0 + slope.abs()),
                    "{op:?} at {a}: {slope}, {difference}"
                );
            }
        }
    }
}
