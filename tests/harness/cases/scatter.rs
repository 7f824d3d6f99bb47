//! Cases of `scatter`.

use omnix_kernels::scatter::{Scatter, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for Scatter {
    fn kernel(&self) -> &'static str {
        "scatter"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.n + self.c));
        let x = (0..self.m * self.c).map(|_| rng.bits() as u32).collect();
        // The first m of a shuffled 0..n+3: each once, some out of range.
        let mut index = rng.shuffled((self.n + 3).max(self.m));
        index.truncate(self.m as usize);
        vec![Values::U32(x), Values::U32(index), Values::U32((0..self.n * self.c).collect())]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let mut y = args[2].u32().to_vec();
        cpu::scatter(self.c as usize, args[0].u32(), args[1].u32(), &mut y);
        vec![(Y, Values::U32(y))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// One, odd, in fours, above a workgroup, wide, more rows than places; then chosen tokens back to their map.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [[1, 1, 1], [9, 5, 3], [20, 7, 4], [300, 100, 36], [64, 64, 130], [50, 33, 1024], [3, 20, 8]];
    let mut cases: Vec<Case> = tests.into_iter().map(|[n, m, c]| Case::test(Scatter { n, m, c })).collect();
    cases.push(Case::bench("2880 of 11520x512", Scatter { n: 11_520, m: 2880, c: 512 }));
    cases
}
