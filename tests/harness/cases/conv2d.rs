//! Cases of `conv2d`.

use omnix_kernels::conv2d::{Conv2d, Y};
use omnix_kernels::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType, cpu};

use super::{Call, Case, Values, Work};
use crate::{Rng, as_f16};

impl Call for Conv2d {
    fn kernel(&self) -> &'static str {
        "conv2d"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let Numbers { x, w, bias, residuals: [residual, residual2] } = Numbers::of(self, caps);
        let out = residual.len();
        let packed = self.weights.pack(|k, o| w[k * self.weights.n as usize + o]);
        let tensors = [bias, residual, residual2].map(Values::F32);
        [Values::F32(x), Values::Bytes(packed)].into_iter().chain(tensors).chain([Values::Out(out)]).collect()
    }

    fn oracle(&self, caps: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let Numbers { x, w, bias, residuals: [residual, residual2] } = Numbers::of(self, caps);
        let weight = |k: usize, o: usize| w[k * self.weights.n as usize + o];
        vec![(Y, Values::F32(cpu::conv2d(self, &x, &weight, &bias, &residual, &residual2)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// Seeded numbers of a convolution.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Input.
    pub x: Vec<f32>,
    /// Weights `[k][o]`, as f16 holds them.
    pub w: Vec<f32>,
    /// Bias.
    pub bias: Vec<f32>,
    /// Two maps like the output.
    pub residuals: [Vec<f32>; 2],
}

impl Numbers {
    /// Inputs that f16 holds where kernels of `caps` round their operands.
    #[must_use]
    pub fn of(spec: &Conv2d, caps: &Caps) -> Self {
        let [ho, wo] = spec.output();
        let (k, co) = (spec.weights.k as usize, spec.weights.n as usize);
        let mut rng = Rng::new(k as u64 * 31 + co as u64);
        let x = rng.normal((spec.frames * spec.hi * spec.wi * spec.ci) as usize);
        let x = if caps.tier == Tier::Gpu && caps.f16 { as_f16(&x) } else { x };
        let w = as_f16(&rng.normal(k * co).iter().map(|v| v / (k as f32).sqrt()).collect::<Vec<_>>());
        let out = (spec.frames * ho * wo) as usize * co;
        Self { x, w, bias: rng.normal(co), residuals: [rng.normal(out), rng.normal(out)] }
    }
}

/// A plain specification with nothing optional.
#[must_use]
pub fn plain(frames: u32, [hi, wi]: [u32; 2], ci: u32, co: u32, kernel: [u32; 2], stride: u32, padding: u32) -> Conv2d {
    let weights = PackedWeights { k: kernel[0] * kernel[1] * ci, n: co, storage: WeightType::F32 };
    Conv2d {
        frames,
        hi,
        wi,
        ci,
        kernel,
        stride,
        padding,
        weights,
        act: Activation::None,
        relu_input: false,
        bias: false,
        residual: false,
        residual2: false,
    }
}

/// With everything optional.
#[must_use]
pub fn full(mut spec: Conv2d, storage: WeightType, act: Activation) -> Conv2d {
    spec.weights.storage = storage;
    Conv2d { act, relu_input: true, bias: true, residual: true, residual2: true, ..spec }
}

/// A layer of 3x3 with ReLU before and after, and a bias.
#[must_use]
pub fn layer([ci, co]: [u32; 2], size: [u32; 2], stride: u32, storage: WeightType) -> Conv2d {
    let spec = full(plain(1, size, ci, co, [3, 3], stride, 1), storage, Activation::Relu);
    Conv2d { residual: false, residual2: false, ..spec }
}

/// One pixel, odd sizes, several column blocks, several windows of taps, parts of a tap (ci above 512 and 1024); then the 3x3
/// convolutions of the dense heads.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for spec in [
        plain(1, [1, 1], 1, 1, [3, 3], 1, 1),
        plain(2, [5, 7], 3, 5, [3, 3], 1, 1),
        plain(2, [6, 5], 4, 8, [3, 3], 2, 1),
        plain(1, [9, 11], 32, 36, [3, 3], 1, 1),
        plain(3, [4, 5], 64, 64, [3, 3], 1, 1),
        plain(1, [7, 6], 128, 100, [3, 3], 1, 1),
        plain(1, [3, 4], 520, 8, [3, 3], 2, 1),
        plain(1, [2, 3], 1036, 4, [1, 3], 1, 0),
        plain(1, [10, 9], 12, 20, [5, 2], 3, 2),
        plain(1, [28, 29], 3, 64, [14, 14], 14, 0),
        plain(2, [3, 3], 8, 130, [1, 1], 1, 0),
        plain(1, [2, 2], 4, 4, [3, 3], 1, 3),
    ] {
        cases.push(Case::test(spec));
        for storage in [WeightType::F32, WeightType::F16] {
            cases.push(Case::test(full(spec, storage, Activation::Relu)));
        }
        if spec.ci == 32 {
            cases.push(Case::test(full(spec, WeightType::F32, Activation::Gelu)));
        }
    }
    for (ci, co, hi, wi, stride) in [
        (128, 64, 280, 504, 1),
        (64, 64, 160, 288, 1),
        (32, 32, 504, 280, 1),
        (256, 256, 80, 144, 1),
        (384, 384, 20, 36, 2),
        (1024, 256, 20, 36, 1),
    ] {
        for storage in [WeightType::F32, WeightType::F16] {
            let name = format!("{ci}->{co} {hi}x{wi}/{stride} {storage:?}");
            cases.push(Case::bench(name, layer([ci, co], [hi, wi], stride, storage)));
        }
    }
    cases
}
