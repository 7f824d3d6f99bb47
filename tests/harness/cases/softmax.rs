//! Cases of `softmax`.

use omnix_kernels::softmax::{Softmax, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call with numbers of this spread.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// The specification.
    pub spec: Softmax,
    /// Standard deviation of the inputs.
    pub spread: f32,
}

impl Call for Spread {
    fn kernel(&self) -> &'static str {
        "softmax"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let Softmax { m, n } = self.spec;
        let x: Vec<f32> = Rng::new(u64::from(n)).normal((m * n) as usize).iter().map(|v| v * self.spread).collect();
        let words = x.len();
        vec![Values::F32(x), Values::Out(words)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.spec.m as usize, self.spec.n as usize);
        vec![(Y, Values::F32(cpu::softmax(shape, args[0].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-5
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, odd, sharp, above a workgroup, long; then many short and some long rows.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [(1, 1, 1.0), (3, 7, 1.0), (64, 2, 30.0), (65, 33, 1.0), (200, 100, 300.0), (2, 3000, 4.0)];
    let tests = tests.map(|(m, n, spread)| Case::test(Spread { spec: Softmax { m, n }, spread }));
    let benches = [(20_736, 32), (1296, 1296)]
        .map(|(m, n)| Case::bench(format!("{m}x{n}"), Spread { spec: Softmax { m, n }, spread: 1.0 }));
    tests.into_iter().chain(benches).collect()
}
