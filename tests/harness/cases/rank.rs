//! Cases of `rank`.

use omnix_kernels::rank::{Rank, Which, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// The threshold of training's losses: 98 %.
pub const NEARLY_ALL: Which = Which::Quantile { numerator: 49, denominator: 50 };

/// Numbers of a row.
#[derive(Clone, Debug)]
pub enum Numbers {
    /// All different.
    Normal,
    /// Rounded to halves, so that there are ties.
    Ties,
    /// About a third NaN.
    Holes,
    /// These.
    Given(Vec<f32>),
}

/// A call over numbers of a kind.
#[derive(Clone, Debug)]
pub struct Among {
    /// The specification.
    pub spec: Rank,
    /// Its input.
    pub numbers: Numbers,
}

impl Call for Among {
    fn kernel(&self) -> &'static str {
        "rank"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let rows = self.spec.rows as usize;
        let all = rows * self.spec.n as usize;
        let mut rng = Rng::new(u64::from(self.spec.n));
        let x = match &self.numbers {
            Numbers::Normal => rng.normal(all),
            Numbers::Ties => rng.normal(all).iter().map(|v| (v * 2.0).round()).collect(),
            Numbers::Holes => rng.normal(all).iter().map(|v| if rng.below(3) == 0 { f32::NAN } else { *v }).collect(),
            Numbers::Given(x) => x.clone(),
        };
        let blocks = self.spec.blocks() as usize;
        vec![Values::F32(x), Values::Out(rows), Values::Out(rows * 2), Values::Out(rows * blocks * 4)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::rank(&self.spec, args[0].f32())))]
    }

    /// The very number; NaN equals NaN in the norm, whose other errors are far above this.
    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-12
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, two, around a workgroup and a block, many rows, with ties and holes; every quantile of few numbers; special numbers; then
/// the errors of an image and of a whole sample.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut test = |spec, numbers| cases.push(Case::test(Among { spec, numbers }));
    for [rows, n] in [[1, 1], [3, 2], [2, 63], [1, 65], [5, 1000], [2, 4096], [3, 4097], [1, 20_000], [70, 9]] {
        for which in [Which::At(0), Which::At(n / 3), Which::At(n - 1), NEARLY_ALL] {
            for numbers in [Numbers::Normal, Numbers::Ties, Numbers::Holes] {
                test(Rank { rows, n, which }, numbers);
            }
        }
    }
    for n in 1..12 {
        for numerator in 0..5 {
            test(Rank { rows: 1, n, which: Which::Quantile { numerator, denominator: 4 } }, Numbers::Normal);
        }
    }
    let special = [
        f32::NAN,
        f32::NEG_INFINITY,
        -0.0,
        0.0,
        f32::INFINITY,
        -f32::NAN,
        f32::MIN_POSITIVE / 4.0,
        -1.0,
        f32::MAX,
        f32::MIN,
    ];
    for rank in 0..10 {
        test(Rank { rows: 1, n: 10, which: Which::At(rank) }, Numbers::Given(special.to_vec()));
    }
    for which in [Which::At(0), NEARLY_ALL] {
        test(Rank { rows: 1, n: 3, which }, Numbers::Given(vec![f32::NAN; 3]));
    }
    for n in [280 * 504, 10_000_000] {
        let spec = Rank { rows: 1, n, which: NEARLY_ALL };
        cases.push(Case::bench(format!("98 % of {n}"), Among { spec, numbers: Numbers::Normal }));
    }
    cases
}
