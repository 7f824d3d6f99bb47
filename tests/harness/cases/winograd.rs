//! Cases of `winograd`: convolutions that its kernels compute, on software devices alone.

use omnix_kernels::conv2d::Conv2d;
use omnix_kernels::winograd::{Winograd, Y, transform};
use omnix_kernels::{Activation, Arg, Caps, Dispatch, KernelError, WeightType, cpu};

use super::conv2d::{Numbers, full, layer, plain};
use super::{Call, Case, Values, Work};

impl Call for Winograd {
    fn kernel(&self) -> &'static str {
        "winograd"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let Numbers { x, w, bias, residuals: [residual, residual2] } = Numbers::of(&self.conv, caps);
        let (ci, co) = (self.conv.ci as usize, self.conv.weights.n as usize);
        let weight = |k: usize, o: usize| transform(std::array::from_fn(|tap| w[(tap * ci + k % ci) * co + o]))[k / ci];
        let out = Values::Out(residual.len());
        let tensors = [bias, residual, residual2].map(Values::F32);
        let first = [Values::F32(x), Values::Bytes(self.weights().pack(weight))];
        first.into_iter().chain(tensors).chain([out, Values::Out(self.scratch() as usize)]).collect()
    }

    fn oracle(&self, caps: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let Numbers { x, w, bias, residuals: [residual, residual2] } = Numbers::of(&self.conv, caps);
        let weight = |k: usize, o: usize| w[k * self.conv.weights.n as usize + o];
        vec![(Y, Values::F32(cpu::winograd(self, &x, &weight, &bias, &residual, &residual2)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        4e-6
    }

    /// Effective: of the sum over taps.
    fn work(&self) -> Work {
        Work::Flops(self.conv.flops())
    }
}

/// A convolution of 3x3 with stride 1.
#[must_use]
pub fn spec(frames: u32, size: [u32; 2], ci: u32, co: u32, padding: u32) -> Conv2d {
    plain(frames, size, ci, co, [3, 3], 1, padding)
}

/// Odd sizes, several frames, maps of one tile's width, several blocks and a part of one, all paddings, several bands; then the
/// shapes of `conv2d`.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for conv in [
        spec(1, [1, 1], 8, 4, 1),
        spec(1, [16, 16], 32, 32, 1),
        spec(3, [17, 19], 40, 68, 1),
        spec(1, [300, 1], 32, 36, 1),
        spec(2, [18, 20], 64, 100, 0),
        spec(1, [15, 18], 128, 40, 2),
        spec(1, [5, 7], 520, 36, 1),
        spec(2, [70, 67], 64, 64, 1),
    ] {
        let with = |act| full(conv, WeightType::F32, act);
        for conv in [conv, with(Activation::Relu), with(Activation::None)] {
            cases.push(Case::test(Winograd { conv }));
        }
    }
    for (ci, co, hi, wi) in [
        (128, 64, 280, 504),
        (64, 64, 80, 144),
        (32, 32, 504, 280),
        (128, 128, 160, 288),
        (256, 256, 80, 144),
        (1024, 256, 20, 36),
    ] {
        let conv = layer([ci, co], [hi, wi], 1, WeightType::F32);
        cases.push(Case::bench(format!("{ci}->{co} {hi}x{wi}"), Winograd { conv }));
    }
    cases
}
