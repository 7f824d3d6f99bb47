//! Cases of `token_expand`.

use omnix_kernels::token_expand::{TokenExpand, Z};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for TokenExpand {
    fn kernel(&self) -> &'static str {
        "token_expand"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.m * 7 + self.d));
        let (m, d, times) = (self.m as usize, self.d as usize, self.times as usize);
        let parts = [(m * d, true), (times * d, self.scale), (times * d, true), (m, self.alpha), (m, self.kappa)];
        let mut given = |(words, there)| {
            let values = rng.normal(words);
            if there { Values::F32(values) } else { Values::Out(1) }
        };
        let mut args: Vec<Values> = parts.into_iter().map(&mut given).collect();
        args.push(Values::Out(times * m * d));
        args
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let parts = [0, 1, 2, 3, 4].map(|i| args[i].f32());
        vec![(Z, Values::F32(cpu::token_expand(self, parts)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-7
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// A specification; bits of `optional` switch scale, alpha and kappa on.
#[must_use]
pub fn spec([times, m, d]: [u32; 3], optional: u32) -> TokenExpand {
    TokenExpand { m, d, times, scale: optional & 1 != 0, alpha: optional & 2 != 0, kappa: optional & 4 != 0 }
}

/// All sizes with and without each part; then chosen tokens times target times.
#[must_use]
pub fn cases() -> Vec<Case> {
    let sizes = [[1, 1, 1], [3, 5, 7], [2, 9, 32], [4, 70, 12], [1, 3, 260], [16, 33, 64]];
    let mut cases: Vec<Case> =
        (0..8).flat_map(|optional| sizes.map(|sizes| Case::test(spec(sizes, optional)))).collect();
    for [times, m, d] in [[16, 2304, 512], [16, 192, 192]] {
        cases.push(Case::bench(format!("{times}x{m}x{d}"), spec([times, m, d], 4)));
    }
    cases
}
