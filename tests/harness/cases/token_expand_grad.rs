//! Cases of `token_expand_grad`.

use omnix_kernels::token_expand_grad::{DQ, DROW, DTIME, TokenExpandGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for TokenExpandGrad {
    fn kernel(&self) -> &'static str {
        "token_expand_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.m * 7 + self.d));
        let (m, d, times) = (self.m as usize, self.d as usize, self.times as usize);
        let parts = [
            (m * d, true),
            (times * d, self.scale),
            (times * d, true),
            (m, self.alpha),
            (m, self.kappa),
            (times * m * d, true),
        ];
        let given = parts.into_iter().map(|(words, there)| {
            let values = rng.normal(words);
            if there { Values::F32(values) } else { Values::Out(1) }
        });
        let blocks = self.blocks() as usize;
        let out = [m * d, m * 2, times * 2 * d, m * 3 * d, times * blocks * 2 * d].map(Values::Out);
        given.chain(out).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let parts = [0, 1, 2, 3, 4, 5].map(|i| args[i].f32());
        let (dq, drow, dtime) = cpu::token_expand_grad(self, parts);
        vec![(DQ, Values::F32(dq)), (DROW, Values::F32(drow)), (DTIME, Values::F32(dtime))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// A specification; bits of `optional` switch scale, alpha and kappa on.
#[must_use]
pub fn spec([times, m, d]: [u32; 3], optional: u32) -> TokenExpandGrad {
    TokenExpandGrad { m, d, times, scale: optional & 1 != 0, alpha: optional & 2 != 0, kappa: optional & 4 != 0 }
}

/// All sizes with and without each part; then chosen tokens times target times.
#[must_use]
pub fn cases() -> Vec<Case> {
    let sizes = [[1, 1, 1], [3, 5, 7], [2, 9, 32], [4, 70, 12], [1, 3, 260], [16, 33, 64], [2, 300, 5]];
    let mut cases: Vec<Case> =
        (0..8).flat_map(|optional| sizes.map(|sizes| Case::test(spec(sizes, optional)))).collect();
    for [times, m, d] in [[16, 2304, 512], [16, 192, 192]] {
        cases.push(Case::bench(format!("{times}x{m}x{d}"), spec([times, m, d], 4)));
    }
    cases
}
