//! `rank` against its oracle.

use omnix_kernels::rank::{Rank, Which, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::rank::{Among, NEARLY_ALL, Numbers, cases};
use omnix_tests::cases::{Call as _, Case, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "rank",
        device: [matches_the_oracle_with_and_without_ties, long_rows_are_right, splitting_at_the_binding_limit_changes_nothing],
        once: [impossible_ranks_are_errors],
    )
}

fn matches_the_oracle_with_and_without_ties(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn long_rows_are_right(gpu: &Gpu) {
    let spec = Rank { rows: 1, n: 1_000_001, which: NEARLY_ALL };
    check_all(gpu, [Numbers::Ties, Numbers::Holes].map(|numbers| Case::test(Among { spec, numbers })));
}

fn splitting_at_the_binding_limit_changes_nothing(gpu: &Gpu) {
    for (rows, n, limit, least) in [(37, 301, 4096, 80), (2, 50_000, 40_000, 150)] {
        let small = with_max_binding(gpu, limit);
        let call = Among { spec: Rank { rows, n, which: NEARLY_ALL }, numbers: Numbers::Holes };
        assert!(call.record(&small.caps).expect("records").len() > least);
        let args = call.args(&small.caps);
        let on = |gpu: &Gpu| results(gpu, &call, &args, &[Y]);
        assert!(on(&small) == on(gpu));
    }
}

fn impossible_ranks_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for (rows, n, which) in [
        (0, 4, Which::At(0)),
        (1, 0, Which::At(0)),
        (1, 4, Which::Quantile { numerator: 1, denominator: 0 }),
        (1, 4, Which::Quantile { numerator: 3, denominator: 2 }),
        (1, 4, Which::Quantile { numerator: 3, denominator: 70_000 }),
    ] {
        assert!(Rank { rows, n, which }.record(&caps).is_err(), "{rows} {n} {which:?}");
    }
    let error = Rank { rows: 1, n: 1000, which: Which::At(0) }.record(&caps).expect_err("long").to_string();
    assert!(error.contains("binds at most 1024"), "{error}");
}
