//! Cases of `layer_norm_grad`.

use omnix_kernels::layer_norm_grad::{D_BIAS, D_WEIGHT, DX, LayerNormGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call over numbers around `offset`.
#[derive(Clone, Copy, Debug)]
pub struct AroundGrad {
    /// The specification.
    pub spec: LayerNormGrad,
    /// Mean of the inputs.
    pub offset: f32,
}

impl Call for AroundGrad {
    fn kernel(&self) -> &'static str {
        "layer_norm_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let (m, c) = (self.spec.m as usize, self.spec.c as usize);
        let mut rng = Rng::new(u64::from(self.spec.m * 31 + self.spec.c));
        let x = rng.normal(m * c).iter().map(|v| v * 3.0 + self.offset).collect();
        let given = [x, rng.normal(c), rng.normal(m * c)].map(Values::F32);
        let column = |there: bool| Values::Out(if there { c } else { 0 });
        let columns = [column(self.spec.d_weight), column(self.spec.d_bias)];
        let scratch = [Values::Out(m * 2), Values::Out(self.spec.parts_words() as usize)];
        given.into_iter().chain([Values::Out(m * c)]).chain(columns).chain(scratch).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let spec = &self.spec;
        let weight = spec.weight.then(|| args[1].f32());
        let shape = (spec.m as usize, spec.c as usize);
        let (dx, d_weight, d_bias) = cpu::layer_norm_grad(shape, args[0].f32(), spec.eps, weight, args[2].f32());
        let mut wanted = vec![(DX, Values::F32(dx))];
        wanted.extend(spec.d_weight.then_some((D_WEIGHT, Values::F32(d_weight))));
        wanted.extend(spec.d_bias.then_some((D_BIAS, Values::F32(d_bias))));
        wanted
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        // One-pass variance would lose everything at a mean far from 0.
        if self.offset == 0.0 { 3e-6 } else { 2e-4 }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// `m` rows of `c` channels with eps 1e-6; with everything, or with nothing optional.
#[must_use]
pub const fn spec(m: u32, c: u32, full: bool) -> LayerNormGrad {
    LayerNormGrad { m, c, eps: 1e-6, weight: full, d_weight: full, d_bias: full }
}

/// Rows and channels: odd, below and above a subgroup, a workgroup, a tile of rows, a part and a section.
const SHAPES: &[(u32, u32)] = &[
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
    (700, 24),
    (1030, 6),
];

/// All shapes; then the tokens of the small and large networks.
#[must_use]
pub fn cases() -> Vec<Case> {
    let test = |spec| Case::test(AroundGrad { spec, offset: 0.0 });
    let mut cases = Vec::new();
    for &(m, c) in SHAPES {
        cases.extend([true, false].map(|full| test(spec(m, c, full))));
    }
    for (d_weight, d_bias) in [(true, false), (false, true)] {
        cases.push(test(LayerNormGrad { d_weight, d_bias, ..spec(400, 40, true) }));
        cases.push(test(LayerNormGrad { d_weight, d_bias, weight: false, ..spec(4, 40, true) }));
    }
    for (m, c) in [(1296, 384), (5184, 1024), (20_736, 1024)] {
        cases.push(Case::bench(format!("{m}x{c}"), AroundGrad { spec: spec(m, c, true), offset: 0.0 }));
    }
    cases
}
