//! Cases of `fill`.

use omnix_kernels::fill::{Fill, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};

impl Call for Fill {
    fn kernel(&self) -> &'static str {
        "fill"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    /// A tensor with three words behind the last that is written.
    fn args(&self, _: &Caps) -> Vec<Values> {
        vec![Values::Out((self.first + self.n) as usize + 3)]
    }

    fn oracle(&self, _: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        // What is not written keeps the bits that it had.
        let mut y = vec![0xffff_ffff; (self.first + self.n) as usize + 3];
        cpu::fill(self, &mut y);
        vec![(Y, Values::U32(y))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// One word, a part that starts and ends between fours, whole fours, below and above a workgroup; numbers, NaN and plain bits; then
/// a map.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (first, n) in [(0, 1), (0, 4), (3, 7), (4, 8), (8, 2047), (5, 2048), (64, 2048), (12, 100_000), (0, 4100)] {
        for value in [0, 0x7fc0_0001, 1.5f32.to_bits(), 0x8000_0000, 77] {
            cases.push(Case::test(Fill { first, n, value }));
        }
    }
    cases.push(Case::bench("4M", Fill::whole(1 << 22, 0.0)));
    cases.push(Case::bench("4M-1", Fill::whole((1 << 22) - 1, 0.0)));
    cases
}
