//! Cases of `linear_weights`.

use omnix_kernels::linear_weights::{DB, DW, LinearWeights};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for LinearWeights {
    fn kernel(&self) -> &'static str {
        "linear_weights"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let (m, n, k) = (self.m as usize, self.n as usize, self.k as usize);
        let mut rng = Rng::new(u64::from(self.m.wrapping_mul(31).wrapping_add(self.n * 7 + self.k)));
        let (x, dy) = (rng.normal(m * k), rng.normal(m * n));
        let bias = Values::Out(if self.bias { n } else { 0 });
        vec![Values::F32(x), Values::F32(dy), Values::Out(n * k), bias, Values::Out(self.parts_words() as usize)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.m as usize, self.n as usize, self.k as usize);
        let (dw, db) = cpu::linear_weights(shape, args[0].f32(), args[1].f32());
        let weights = (DW, Values::F32(dw));
        if self.bias { vec![weights, (DB, Values::F32(db))] } else { vec![weights] }
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// Gradients of `m` rows, with those of the bias.
#[must_use]
pub const fn spec(m: u32, n: u32, k: u32) -> LinearWeights {
    LinearWeights { m, n, k, bias: true }
}

/// Rows, columns of dy and of x: one, odd, around a tile, a part and a section.
const SHAPES: &[(u32, u32, u32)] = &[
    (1, 1, 1),
    (1, 4, 4),
    (3, 7, 9),
    (5, 36, 588),
    (63, 32, 64),
    (64, 33, 13),
    (65, 100, 36),
    (130, 96, 520),
    (255, 64, 32),
    (257, 8, 1028),
    (600, 68, 132),
    (1000, 2, 32),
    (1027, 12, 20),
    (90, 1, 100),
];

/// All shapes, with and without a bias; then the layers of the small network over 1 and 4 images, of the large one, and a narrow one.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for &(m, n, k) in SHAPES {
        cases.push(Case::test(spec(m, n, k)));
        cases.push(Case::test(LinearWeights { bias: false, ..spec(m, n, k) }));
    }
    for (m, n, k) in [
        (1296, 1152, 384),
        (1296, 1536, 384),
        (1296, 384, 1536),
        (4096, 3072, 1024),
        (20_736, 512, 512),
        (92_160, 64, 64),
        (141_120, 2, 32),
    ] {
        cases.push(Case::bench(format!("{m}x{n}x{k}"), spec(m, n, k)));
    }
    cases
}
