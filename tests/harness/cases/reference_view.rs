//! Cases of `reference_view`. Where several views are as good but for rounding, its test compares scores and not choices, so here
//! the views are those with a clear winner.

use omnix_kernels::reference_view::{INVERSE, ORDER, REF, ReferenceView, Strategy};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for ReferenceView {
    fn kernel(&self) -> &'static str {
        "reference_view"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let s = self.s as usize;
        let x = tokens(self.s, self.c, u64::from(self.s + self.c));
        vec![Values::F32(x), Values::Out(s), Values::Out(s), Values::Out(1)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.s as usize, self.c as usize);
        let reference = cpu::reference_view(self.strategy, shape, args[0].f32()) as u32;
        let order: Vec<u32> = std::iter::once(reference).chain((0..self.s).filter(|i| *i != reference)).collect();
        let mut inverse = vec![0; order.len()];
        for (i, view) in order.iter().enumerate() {
            inverse[*view as usize] = i as u32;
        }
        vec![(REF, Values::U32(vec![reference])), (ORDER, Values::U32(order)), (INVERSE, Values::U32(inverse))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    /// Every pair of tokens, two products each.
    fn work(&self) -> Work {
        Work::Flops(4 * u64::from(self.s) * u64::from(self.s) * u64::from(self.c))
    }
}

/// Class tokens as networks give them: alike, of lengths around 10.
#[must_use]
pub fn tokens(s: u32, c: u32, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let common = rng.normal(c as usize);
    (0..s)
        .flat_map(|_| {
            let own = rng.normal(c as usize);
            (0..c as usize).map(|i| common[i] + 0.4 * own[i]).collect::<Vec<_>>()
        })
        .collect()
}

/// Choices that do not depend on rounding; then the class tokens of few and of many views.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for s in [1, 2, 3, 8, 65] {
        for strategy in [Strategy::First, Strategy::Middle, Strategy::Forced(s - 1)] {
            cases.push(Case::test(ReferenceView { s, c: 12, strategy }));
        }
    }
    for s in [8, 256] {
        let strategy = Strategy::SaddleBalanced;
        cases.push(Case::bench(format!("{s}x1024"), ReferenceView { s, c: 1024, strategy }));
    }
    cases
}
