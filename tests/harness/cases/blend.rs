//! Cases of `blend`.

use omnix_kernels::blend::{Blend, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call with these shares.
#[derive(Clone, Copy, Debug)]
pub struct Shared {
    /// The specification.
    pub spec: Blend,
    /// Of y and of x.
    pub shares: [f32; 2],
}

impl Call for Shared {
    fn kernel(&self) -> &'static str {
        "blend"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let n = self.spec.n as usize;
        let mut rng = Rng::new(self.spec.n);
        // What is left out may be anything.
        let mut numbers = |share: f32| {
            let v = rng.normal(n);
            if share == 0.0 { vec![f32::NAN; n] } else { v }
        };
        let (y, x) = (numbers(self.shares[0]), numbers(self.shares[1]));
        vec![Values::F32(y), Values::F32(x), Values::F32(self.shares.to_vec())]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::blend(args[0].f32(), args[1].f32(), self.shares)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, odd, fours, above a workgroup; sums, averages, and either alone; then the weights of a layer.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for n in [1, 7, 64, 300, 4101, 5000] {
        for shares in [[1.0, 1.0], [0.999, 0.001], [0.0, 1.0], [1.0, 0.0]] {
            cases.push(Case::test(Shared { spec: Blend { n }, shares }));
        }
    }
    cases.push(Case::bench("4M", Shared { spec: Blend { n: 1 << 22 }, shares: [1.0, 1.0] }));
    cases
}
