//! Cases of `reduce`.

use omnix_kernels::reduce::{Reduce, ReduceOp, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// All operations.
pub const OPS: [ReduceOp; 5] = [ReduceOp::Sum, ReduceOp::Mean, ReduceOp::Max, ReduceOp::Min, ReduceOp::Std];

impl Call for Reduce {
    fn kernel(&self) -> &'static str {
        "reduce"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let len = (self.outer * self.n * self.inner) as usize;
        // Far from 0, so that a one-pass deviation would show.
        let x = Rng::new(u64::from(self.n)).normal(len).iter().map(|v| v + 20.0).collect();
        let scratch = self.scratch().map(|words| Values::Out(words as usize));
        let args = [Values::F32(x), Values::Out((self.outer * self.inner) as usize)];
        args.into_iter().chain(scratch).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.outer as usize, self.n as usize, self.inner as usize);
        vec![(Y, Values::F32(cpu::reduce(shape, self.op, args[0].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-5
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// One, a single output, odd, above a workgroup, over the middle axis; axes that are cut into blocks, once and twice; then the last
/// axis and the middle one of networks, columns of gradients and a loss.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (outer, n, inner) in [(1, 1, 1), (1, 1000, 1), (3, 7, 5), (65, 2, 1), (2, 33, 64), (70, 1, 3)] {
        cases.extend(OPS.map(|op| Case::test(Reduce { outer, n, inner, op })));
    }
    for (outer, n, inner) in
        [(1, 1025, 1), (3, 5000, 1), (1, 300_000, 1), (2, 1100, 3), (1, 3000, 70), (1, 70_000, 5), (40, 2048, 2)]
    {
        // A deviation goes around a mean of one long sum, which is off by more the longer it is.
        let ops = OPS.into_iter().filter(|op| n <= 5000 || *op != ReduceOp::Std);
        cases.extend(ops.map(|op| Case::test(Reduce { outer, n, inner, op })));
    }
    for (outer, n, inner) in [(1, 46_144, 384), (1, 10_000_000, 1), (1, 2_257_920, 9)] {
        cases.push(Case::bench(format!("sum {outer}x{n}x{inner}"), Reduce { outer, n, inner, op: ReduceOp::Sum }));
    }
    for (outer, n, inner) in [(20_736, 256, 1), (16, 720, 384)] {
        for op in [ReduceOp::Mean, ReduceOp::Std] {
            cases.push(Case::bench(format!("{op:?} {outer}x{n}x{inner}"), Reduce { outer, n, inner, op }));
        }
    }
    cases
}
