//! Cases of `dropout`.

use omnix_kernels::dropout::{Dropout, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call at a step.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// The specification.
    pub spec: Dropout,
    /// The step.
    pub step: u32,
}

impl Call for At {
    fn kernel(&self) -> &'static str {
        "dropout"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let n = self.spec.n as usize;
        vec![Values::F32(Rng::new(u64::from(self.spec.n)).normal(n)), Values::U32(vec![self.step]), Values::Out(n)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::dropout(&self.spec, self.step, args[0].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, odd, fours, above a workgroup; all kept, a tenth and nearly all left out; steps, streams and seeds; then a hidden layer.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for n in [1, 7, 64, 300, 4101, 5000] {
        for (p, seed, stream, step) in [
            (0.0, 1, 0, 0),
            (0.1, 1, 0, 0),
            (0.1, 1 << 40, 3, 77),
            (0.5, u64::MAX, u32::MAX, u32::MAX),
            (0.99, 7, 1, 2),
        ] {
            cases.push(Case::test(At { spec: Dropout { n, p, seed, stream }, step }));
        }
    }
    let spec = Dropout { n: 1 << 22, p: 0.1, seed: 1, stream: 0 };
    cases.push(Case::bench("4M", At { spec, step: 1 }));
    cases
}
