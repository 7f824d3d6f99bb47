//! Functions of one number or of two, element by element; the choice between two; gates and dropout.

use omnix_graph::ops::{Binary, Dropout, Map, Operand, Select, SwiGlu, Unary, Zip};
use omnix_kernels::{Activation, dropout};

use super::{Run, index};

impl Run<'_> {
    pub(super) fn map(&self, op: &Map) -> Vec<f64> {
        self.get(op.x).iter().map(|v| unary(op.op, *v)).collect()
    }

    pub(super) fn zip(&self, op: &Zip) -> Vec<f64> {
        self.get(op.a).iter().enumerate().map(|(i, a)| binary(op.op, *a, self.operand(op.b, i))).collect()
    }

    pub(super) fn select(&self, op: &Select) -> Vec<f64> {
        let chosen = |(i, (a, b)): (usize, (&f64, &f64))| if self.operand(op.mask, i) == 0.0 { *b } else { *a };
        self.get(op.a).iter().zip(self.get(op.b)).enumerate().map(chosen).collect()
    }

    pub(super) fn swiglu(&self, op: &SwiGlu) -> Vec<f64> {
        let width = self.width(op.x);
        let gated = |row: &[f64]| {
            let (a, b) = row.split_at(width / 2);
            a.iter().zip(b).map(|(a, b)| silu(*a) * b).collect::<Vec<_>>()
        };
        self.get(op.x).chunks_exact(width).flat_map(gated).collect()
    }

    /// Which numbers are left out is the oracle's to say; the rest grow by 1 / (1 - p).
    pub(super) fn dropout(&self, op: &Dropout) -> Vec<f64> {
        let (x, step) = (self.get(op.x), index(self.get(op.step)[0]) as u32);
        let spec = dropout::Dropout { n: x.len() as u32, p: op.p, seed: op.seed, stream: op.stream };
        let drawn = omnix_kernels::cpu::dropout(&spec, step, &vec![1.0; x.len()]);
        x.iter().zip(drawn).map(|(v, kept)| if kept == 0.0 { 0.0 } else { v / (1.0 - f64::from(op.p)) }).collect()
    }

    /// What an operand holds for element `i`.
    fn operand(&self, operand: Operand, i: usize) -> f64 {
        self.get(operand.value)[i / operand.div % operand.len]
    }
}

/// An activation that fusion moved into a product, convolution or norm.
pub(super) fn activate(act: Activation, v: f64) -> f64 {
    match act {
        Activation::None => v,
        Activation::Relu => v.max(0.0),
        Activation::Gelu => gelu(v),
        Activation::Silu => silu(v),
    }
}

fn silu(v: f64) -> f64 {
    v / (1.0 + (-v).exp())
}

fn gelu(v: f64) -> f64 {
    0.5 * v * (1.0 + erf(v * std::f64::consts::FRAC_1_SQRT_2))
}

/// `2/√π · exp(-x²) · Σ 2ⁿ x²ⁿ⁺¹ / (1 · 3 · .. · (2n + 1))`: all terms have one sign, so that none cancels another.
fn erf(x: f64) -> f64 {
    if x.abs() > 6.0 {
        return x.signum();
    }
    let (mut term, mut sum, mut n) = (x, x, 0.0);
    while term.abs() > 1e-17 * sum.abs() {
        n += 1.0;
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        sum += term;
    }
    sum * (-x * x).exp() * std::f64::consts::FRAC_2_SQRT_PI
}

fn truth(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

fn unary(op: Unary, v: f64) -> f64 {
    let clamp = |low: f32, high: f32| v.max(f64::from(low)).min(f64::from(high));
    match op {
        Unary::Relu => v.max(0.0),
        Unary::Neg => -v,
        Unary::Abs => v.abs(),
        Unary::Square => v * v,
        Unary::Reciprocal => 1.0 / v,
        Unary::ScaleShift { s, t } => v * f64::from(s) + f64::from(t),
        Unary::Clamp { low, high } => clamp(low, high),
        Unary::Sqrt => v.sqrt(),
        Unary::Below { limit } => truth(v < f64::from(limit)),
        Unary::Gelu => gelu(v),
        Unary::Silu => silu(v),
        Unary::Sigmoid => 1.0 / (1.0 + (-v).exp()),
        Unary::Softplus if v > 20.0 => v,
        Unary::Softplus => v.exp().ln_1p(),
        Unary::Exp => v.exp(),
        Unary::Log => v.ln(),
        Unary::ExpClamped { low, high } => clamp(low, high).exp(),
        Unary::Tanh => v.tanh(),
        Unary::Sign => truth(v > 0.0) - truth(v < 0.0),
        Unary::IsFinite => truth(v.is_finite()),
        Unary::Power { exponent } => v.powf(f64::from(exponent)),
        other => panic!("{other:?} is not interpreted"),
    }
}

fn binary(op: Binary, a: f64, b: f64) -> f64 {
    match op {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Max => a.max(b),
        Binary::Min => a.min(b),
        Binary::Equal => truth(a == b),
        Binary::Less => truth(a < b),
        Binary::Keep if b == 0.0 => 0.0,
        Binary::Drop if b != 0.0 || b.is_nan() => 0.0,
        Binary::Keep | Binary::Drop => a,
    }
}

#[cfg(test)]
mod tests {
    use super::erf;

    #[test]
    fn erf_matches_tabulated_values() {
        for (x, y) in [(0.0, 0.0), (0.5, 0.520_499_877_813_046_5), (2.0, 0.995_322_265_018_952_7)] {
            assert!((erf(x) - y).abs() < 1e-14 && (erf(-x) + y).abs() < 1e-14, "erf({x}) = {}", erf(x));
        }
        assert!((erf(5.9) - 1.0).abs() < 1e-14, "erf(5.9) = {}", erf(5.9));
    }
}
