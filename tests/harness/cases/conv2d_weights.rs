//! Cases of `conv2d_weights`.

use omnix_kernels::conv2d_weights::{Conv2dWeights, DB, DW};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for Conv2dWeights {
    fn kernel(&self) -> &'static str {
        "conv2d_weights"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let [ho, wo] = self.output();
        let mut rng = Rng::new(u64::from(self.ci * 31 + self.co));
        let x = rng.normal((self.frames * self.hi * self.wi * self.ci) as usize);
        let dy = rng.normal((self.frames * ho * wo * self.co) as usize);
        let words = (self.co * self.ci * self.kernel[0] * self.kernel[1]) as usize;
        let bias = Values::Out(if self.bias { self.co as usize } else { 0 });
        vec![Values::F32(x), Values::F32(dy), Values::Out(words), bias, Values::Out(self.parts_words() as usize)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let (dw, db) = cpu::conv2d_weights(self, args[0].f32(), args[1].f32());
        let weights = (DW, Values::F32(dw));
        if self.bias { vec![weights, (DB, Values::F32(db))] } else { vec![weights] }
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// A specification with a bias.
#[must_use]
pub const fn spec(
    frames: u32,
    [hi, wi]: [u32; 2],
    [ci, co]: [u32; 2],
    kernel: [u32; 2],
    stride: u32,
    padding: u32,
) -> Conv2dWeights {
    Conv2dWeights { frames, hi, wi, ci, co, kernel, stride, padding, bias: true }
}

/// One pixel, odd sizes, several tiles and sections, all kinds of borders; then the 3x3 convolutions of the dense heads.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for spec in [
        spec(1, [1, 1], [1, 1], [3, 3], 1, 1),
        spec(2, [5, 7], [3, 5], [3, 3], 1, 1),
        spec(2, [6, 5], [4, 8], [3, 3], 2, 1),
        spec(1, [9, 11], [32, 36], [3, 3], 1, 1),
        spec(3, [4, 5], [64, 64], [3, 3], 1, 1),
        spec(1, [7, 6], [128, 100], [3, 3], 1, 1),
        spec(1, [3, 4], [132, 8], [3, 3], 2, 1),
        spec(1, [2, 3], [36, 4], [1, 3], 1, 0),
        spec(1, [10, 9], [12, 20], [5, 2], 3, 2),
        spec(1, [28, 29], [3, 64], [14, 14], 14, 0),
        spec(2, [3, 3], [8, 130], [1, 1], 1, 0),
        spec(1, [2, 2], [4, 4], [3, 3], 1, 3),
        spec(2, [30, 41], [8, 12], [3, 3], 1, 1),
        spec(1, [70, 3], [8, 4], [3, 3], 1, 1),
        spec(2, [9, 130], [4, 8], [3, 3], 1, 1),
    ] {
        cases.push(Case::test(spec));
        cases.push(Case::test(Conv2dWeights { bias: false, ..spec }));
    }
    for (ci, co, hi, wi, stride) in [
        (128, 64, 280, 504, 1),
        (64, 64, 160, 288, 1),
        (32, 32, 504, 280, 1),
        (256, 256, 80, 144, 1),
        (384, 384, 20, 36, 2),
        (1024, 256, 20, 36, 1),
    ] {
        let name = format!("{ci}->{co} {hi}x{wi}/{stride}");
        cases.push(Case::bench(name, spec(1, [hi, wi], [ci, co], [3, 3], stride, 1)));
    }
    cases
}
