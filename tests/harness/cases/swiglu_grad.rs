//! Cases of `swiglu_grad`.

use omnix_kernels::swiglu_grad::{DX, SwiGluGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for SwiGluGrad {
    fn kernel(&self) -> &'static str {
        "swiglu_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let n = (self.m * self.h) as usize;
        let mut rng = Rng::new(u64::from(self.m * self.h));
        let x = rng.normal(2 * n).iter().map(|v| 3.0 * v).collect();
        vec![Values::F32(x), Values::F32(rng.normal(n)), Values::Out(2 * n)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.m as usize, self.h as usize);
        vec![(DX, Values::F32(cpu::swiglu_grad(shape, args[0].f32(), args[1].f32())))]
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
    let mut cases: Vec<Case> = tests.into_iter().map(|(m, h)| Case::test(SwiGluGrad { m, h })).collect();
    cases.push(Case::bench("1442x4096", SwiGluGrad { m: 1442, h: 4096 }));
    cases
}
