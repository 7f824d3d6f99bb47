//! Cases of `swiglu`.

use omnix_kernels::swiglu::{SwiGlu, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for SwiGlu {
    fn kernel(&self) -> &'static str {
        "swiglu"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let out = (self.m * self.h) as usize;
        vec![Values::F32(Rng::new(u64::from(self.m * self.h)).normal(2 * out)), Values::Out(out)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::swiglu((self.m as usize, self.h as usize), args[0].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// One, odd, in fours, above a workgroup; then the tokens of the largest network.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [(1, 1), (3, 5), (7, 4), (50, 36), (129, 65), (40, 128), (300, 44), (3, 28)];
    let mut cases: Vec<Case> = tests.into_iter().map(|(m, h)| Case::test(SwiGlu { m, h })).collect();
    cases.push(Case::bench("1442x4096", SwiGlu { m: 1442, h: 4096 }));
    cases
}
