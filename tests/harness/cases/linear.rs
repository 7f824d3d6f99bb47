//! Cases of `linear`.

use omnix_kernels::linear::{Linear, Y};
use omnix_kernels::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType, cpu};

use super::{Call, Case, Values, Work};
use crate::{Rng, as_f16};

impl Call for Linear {
    fn kernel(&self) -> &'static str {
        "linear"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let Numbers { x, w, bias, gamma, residual } = Numbers::of(self, caps);
        let out = residual.len();
        let packed = self.weights.pack(|row, column| w[column * self.weights.k as usize + row]);
        let given = |there: bool, values| if there { Values::F32(values) } else { Values::Out(1) };
        vec![
            Values::F32(x),
            Values::Bytes(packed),
            given(self.bias, bias),
            given(self.gamma, gamma),
            given(self.residual, residual),
            Values::Out(out),
        ]
    }

    fn oracle(&self, caps: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let Numbers { x, w, bias, gamma, residual } = Numbers::of(self, caps);
        let (m, n, k) = (self.m as usize, self.weights.n as usize, self.weights.k as usize);
        let want = cpu::linear(
            (m, n, k),
            &x,
            &|row: usize, column: usize| w[column * k + row],
            self.act,
            self.bias.then_some(bias.as_slice()),
            self.gamma.then_some(gamma.as_slice()),
            self.residual.then_some(residual.as_slice()),
        );
        vec![(Y, Values::F32(want))]
    }

    fn limit(&self, caps: &Caps, _: Arg) -> f64 {
        // Matrix units add with their own rounding (an H200: 2.5e-6 at k = 2052, with f16 operands).
        let products = caps.cooperative;
        let matrix_units = products.f32_8 || products.f16_16 && self.weights.storage != WeightType::F32;
        if matrix_units { 1e-5 } else { 2e-6 }
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// Seeded numbers of a layer.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Input.
    pub x: Vec<f32>,
    /// Weights `[column][row]`, as they are stored.
    pub w: Vec<f32>,
    /// `[n]`.
    pub bias: Vec<f32>,
    /// `[n]`.
    pub gamma: Vec<f32>,
    /// `[m, n]`.
    pub residual: Vec<f32>,
}

impl Numbers {
    /// Inputs that f16 holds where kernels of `caps` round their operands.
    #[must_use]
    pub fn of(spec: &Linear, caps: &Caps) -> Self {
        let PackedWeights { k, n, storage } = spec.weights;
        let mut rng = Rng::new(u64::from(spec.m.wrapping_mul(31).wrapping_add(n * 7 + k)));
        let (m, n, k) = (spec.m as usize, n as usize, k as usize);
        let x = rng.normal(m * k);
        let x = if caps.tier == Tier::Gpu && caps.f16 { as_f16(&x) } else { x };
        let w = as_f16(&rng.normal(n * k).iter().map(|v| v / (k as f32).sqrt()).collect::<Vec<_>>());
        let w = if storage == WeightType::I8 { as_int8(&w, k) } else { w };
        Self { x, w, bias: rng.normal(n), gamma: rng.normal(n), residual: rng.normal(m * n) }
    }
}

/// Columns of `k` weights to the nearest of 255 steps between the column's largest and its negative.
fn as_int8(w: &[f32], k: usize) -> Vec<f32> {
    let column = |c: &[f32]| {
        let scale = c.iter().fold(0.0f32, |most, w| most.max(w.abs())) / 127.0;
        c.iter().map(|w| (w / scale).round() * scale).collect::<Vec<_>>()
    };
    w.chunks(k).flat_map(column).collect()
}

/// A layer with or without everything optional.
#[must_use]
pub fn spec((m, n, k): (u32, u32, u32), storage: WeightType, act: Activation, full: bool) -> Linear {
    Linear { m, weights: PackedWeights { k, n, storage }, act, bias: full, gamma: full, residual: full }
}

/// All ways that weights are stored.
pub const STORAGES: [WeightType; 3] = [WeightType::F32, WeightType::F16, WeightType::I8];

/// Rows, columns, depth: one, odd, tile edges, several column blocks, several uniform windows.
const SHAPES: &[(u32, u32, u32)] = &[
    (1, 1, 1),
    (1, 4, 4),
    (3, 7, 9),
    (5, 36, 588),
    (16, 32, 64),
    (17, 33, 13),
    (33, 100, 36),
    (130, 96, 520),
    (64, 8, 1028),
    (70, 68, 2052),
    (37, 2, 32),
    (9, 3, 4),
    (70, 7, 100),
];

/// All shapes, stored in every way, with every activation; then the products of the small and large networks.
#[must_use]
pub fn cases() -> Vec<Case> {
    let forms =
        [(Activation::None, false), (Activation::Gelu, true), (Activation::Relu, true), (Activation::Silu, false)];
    let mut cases = Vec::new();
    for &shape in SHAPES {
        for storage in STORAGES {
            cases.extend(forms.map(|(act, full)| Case::test(spec(shape, storage, act, full))));
        }
    }
    for (m, n, k) in [
        (1296, 1152, 384),
        (1296, 1536, 384),
        (1296, 384, 1536),
        (4096, 3072, 1024),
        (20_736, 512, 512),
        (141_120, 2, 32),
    ] {
        for storage in STORAGES {
            let layer = Linear { bias: true, ..spec((m, n, k), storage, Activation::None, false) };
            cases.push(Case::bench(format!("{m}x{n}x{k} {storage:?}"), layer));
        }
    }
    cases
}
