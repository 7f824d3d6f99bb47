//! Cases of `gather`.

use omnix_kernels::gather::{Gather, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for Gather {
    fn kernel(&self) -> &'static str {
        "gather"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.n + self.c));
        let x = (0..self.n * self.c).map(|_| rng.bits() as u32).collect();
        // Some out of range, just above and far away.
        let index = (0..self.m).map(|i| if i % 7 == 3 { u32::MAX } else { rng.below(self.n + 1) }).collect();
        vec![Values::U32(x), Values::U32(index), Values::Out((self.m * self.c) as usize)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::U32(cpu::gather(self.c as usize, args[0].u32(), args[1].u32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// One, odd, in fours, above a workgroup, wide; then chosen tokens of a map.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [[1, 1, 1], [5, 9, 3], [20, 7, 4], [100, 300, 36], [64, 64, 130], [33, 50, 1024]];
    let mut cases: Vec<Case> = tests.into_iter().map(|[n, m, c]| Case::test(Gather { n, m, c })).collect();
    cases.push(Case::bench("2880 of 11520x512", Gather { n: 11_520, m: 2880, c: 512 }));
    cases
}
