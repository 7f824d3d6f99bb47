//! Cases of `adamw`.

use omnix_kernels::adamw::{AdamW, FIRST, SECOND, WEIGHTS};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// As training sets it.
pub const TRAINING: AdamW = AdamW { n: 1, betas: [0.9, 0.95], eps: 1e-8, scale: 1.0, clip: true };

/// A call at a step.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// The specification.
    pub spec: AdamW,
    /// The step, from 1.
    pub step: u64,
    /// Factor of the gradients, and whether their norm is NaN or infinite.
    pub clip: [f32; 4],
}

impl Call for At {
    fn kernel(&self) -> &'static str {
        "adamw"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let n = self.spec.n as usize;
        let mut rng = Rng::new(self.spec.n + self.step);
        let weights = rng.normal(n);
        // Before the first step there are no moments.
        let was = if self.step > 1 { 1.0 } else { 0.0 };
        let first = rng.normal(n).iter().map(|v| 0.1 * was * v).collect();
        let second = rng.normal(n).iter().map(|v| 0.01 * was * v * v).collect();
        let gradient = rng.normal(n).iter().map(|v| 0.3 * v).collect();
        let rates = self.spec.rates(self.step, 0.01, 0.05).to_vec();
        let clip = if self.spec.clip { Values::F32(self.clip.to_vec()) } else { Values::Out(1) };
        let numbers = [weights, first, second, gradient, rates].map(Values::F32);
        numbers.into_iter().chain([clip]).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let [weights, first, second, gradient, rates, clip] = [0, 1, 2, 3, 4, 5].map(|i| args[i].f32());
        let new = cpu::adamw(&self.spec, [weights, first, second], gradient, rates, clip);
        [WEIGHTS, FIRST, SECOND].into_iter().zip(new.map(Values::F32)).collect()
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, odd, fours, above a workgroup; first and later steps; with and without a clip; then the weights of a layer.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for n in [1, 7, 64, 300, 4101, 5000] {
        for step in [1, 2, 1000] {
            for (clip, scale) in [(true, 1.0), (false, 0.25)] {
                let spec = AdamW { n, scale, clip, ..TRAINING };
                cases.push(Case::test(At { spec, step, clip: [0.3, 1.0, 0.0, 0.0] }));
            }
        }
    }
    let spec = AdamW { n: 1 << 22, ..TRAINING };
    cases.push(Case::bench("4M", At { spec, step: 7, clip: [0.3, 1.0, 0.0, 0.0] }));
    cases
}
