//! Cases of `top_k`.

use omnix_kernels::top_k::{INDEX, MASK, TopK};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// Numbers of a row.
#[derive(Clone, Debug)]
pub enum Numbers {
    /// All different.
    Normal,
    /// Rounded to halves, so that there are ties.
    Ties,
    /// Equal.
    Same,
    /// These.
    Given(Vec<f32>),
}

/// A call over numbers of a kind.
#[derive(Clone, Debug)]
pub struct Among {
    /// The specification.
    pub spec: TopK,
    /// Its input.
    pub numbers: Numbers,
}

impl Call for Among {
    fn kernel(&self) -> &'static str {
        "top_k"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let TopK { rows, n, k, .. } = self.spec;
        let all = (rows * n) as usize;
        let normal = || Rng::new(u64::from(n)).normal(all);
        let x = match &self.numbers {
            Numbers::Normal => normal(),
            Numbers::Ties => normal().iter().map(|v| (v * 2.0).round()).collect(),
            Numbers::Same => vec![0.25; all],
            Numbers::Given(x) => x.clone(),
        };
        vec![Values::F32(x), Values::Out((rows * k) as usize), Values::Out(all)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let shape = (self.spec.n as usize, self.spec.k as usize);
        let (index, mask) = cpu::top_k(shape, self.spec.flat, args[0].f32());
        vec![(INDEX, Values::U32(index)), (MASK, Values::F32(mask))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// One, all, a workgroup and one more, long rows, many rows, with and without ties; numbers that are special; then the scores of
/// 16 images, and one long row.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut test = |spec, numbers| cases.push(Case::test(Among { spec, numbers }));
    for [rows, n, k] in
        [[1, 1, 1], [3, 7, 1], [2, 7, 7], [4, 64, 10], [5, 65, 64], [2, 720, 72], [1, 1000, 999], [300, 9, 4]]
    {
        let spec = TopK { rows, n, k, flat: false };
        test(spec, Numbers::Normal);
        test(TopK { flat: true, ..spec }, Numbers::Normal);
        test(spec, Numbers::Ties);
        test(spec, Numbers::Same);
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
    for k in 1..=10 {
        test(TopK { rows: 1, n: 10, k, flat: false }, Numbers::Given(special.to_vec()));
    }
    for [rows, n, k] in [[16, 720, 180], [1, 100_000, 10_000]] {
        let spec = TopK { rows, n, k, flat: false };
        cases.push(Case::bench(format!("{k} of {rows}x{n}"), Among { spec, numbers: Numbers::Normal }));
    }
    cases
}
