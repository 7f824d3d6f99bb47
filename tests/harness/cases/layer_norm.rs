//! Cases of `layer_norm`.

use omnix_kernels::layer_norm::{LayerNorm, Y};
use omnix_kernels::{Activation, Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call over numbers around `offset`.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    /// The specification.
    pub spec: LayerNorm,
    /// Mean of the inputs.
    pub offset: f32,
}

impl Call for Around {
    fn kernel(&self) -> &'static str {
        "layer_norm"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let (m, c) = (self.spec.m as usize, self.spec.c as usize);
        let mut rng = Rng::new(u64::from(self.spec.m * 31 + self.spec.c));
        let x = rng.normal(m * c).iter().map(|v| v * 3.0 + self.offset).collect();
        vec![Values::F32(x), Values::F32(rng.normal(c)), Values::F32(rng.normal(c)), Values::Out(m * c)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let spec = &self.spec;
        let given = |on: bool, at: usize| on.then(|| args[at].f32());
        let (weight, bias) = (given(spec.weight, 1), given(spec.bias, 2));
        let shape = (spec.m as usize, spec.c as usize);
        vec![(Y, Values::F32(cpu::layer_norm(shape, args[0].f32(), spec.eps, spec.act, weight, bias)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        // One-pass variance would lose everything at a mean far from 0.
        if self.offset == 0.0 { 2e-6 } else { 2e-4 }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// `m` rows of `c` channels with eps 1e-6.
#[must_use]
pub fn spec(m: u32, c: u32, act: Activation, affine: bool) -> LayerNorm {
    LayerNorm { m, c, eps: 1e-6, act, weight: affine, bias: affine }
}

/// Rows and channels: one, odd, below and above a subgroup, a workgroup and a tile of rows.
const SHAPES: &[(u32, u32)] = &[
    (1, 1),
    (2, 3),
    (3, 4),
    (5, 30),
    (65, 32),
    (7, 36),
    (7, 72),
    (130, 63),
    (9, 384),
    (66, 1024),
    (3, 2048),
    (3, 4100),
    (3, 4104),
];

/// All shapes with and without weights; then the tokens of the small and large networks.
#[must_use]
pub fn cases() -> Vec<Case> {
    let test = |spec| Case::test(Around { spec, offset: 0.0 });
    let mut cases = Vec::new();
    for &(m, c) in SHAPES {
        let forms = [(Activation::None, true), (Activation::Gelu, false), (Activation::Relu, true)];
        cases.extend(forms.map(|(act, affine)| test(spec(m, c, act, affine))));
    }
    for (weight, bias) in [(true, false), (false, true)] {
        cases.push(test(LayerNorm { weight, bias, ..spec(4, 40, Activation::None, true) }));
    }
    for (m, c) in [(1296, 384), (5184, 1024), (20_736, 1024)] {
        let spec = spec(m, c, Activation::None, true);
        cases.push(Case::bench(format!("{m}x{c}"), Around { spec, offset: 0.0 }));
    }
    cases
}
