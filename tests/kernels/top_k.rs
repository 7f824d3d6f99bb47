//! `top_k` against its oracle.

use omnix_kernels::top_k::{INDEX, MASK, TopK};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::top_k::{Among, Numbers, cases};
use omnix_tests::cases::{Call as _, Case, check_all, results};
use omnix_tests::{Rng, Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "top_k",
        device: [matches_the_oracle_with_and_without_ties, long_rows_are_right, splitting_at_the_binding_limit_changes_nothing],
        once: [impossible_choices_are_errors],
    )
}

fn matches_the_oracle_with_and_without_ties(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn long_rows_are_right(gpu: &Gpu) {
    let (n, k) = (100_000, 10_000);
    let x = Rng::new(1).normal(n).iter().map(|v| (v * 1000.0).round()).collect();
    let spec = TopK { rows: 1, n: n as u32, k, flat: false };
    check_all(gpu, [Case::test(Among { spec, numbers: Numbers::Given(x) })]);
}

fn splitting_at_the_binding_limit_changes_nothing(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    let call = Among { spec: TopK { rows: 37, n: 301, k: 30, flat: true }, numbers: Numbers::Normal };
    assert!(call.record(&small.caps).expect("records").len() > 5);
    let args = call.args(&small.caps);
    let on = |gpu: &Gpu| results(gpu, &call, &args, &[INDEX, MASK]);
    assert!(on(&small) == on(gpu));
}

fn impossible_choices_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for [rows, n, k] in [[0, 4, 1], [1, 4, 5], [1, 4, 0]] {
        assert!(TopK { rows, n, k, flat: false }.record(&caps).is_err());
    }
    assert!(
        TopK { rows: 1, n: 1000, k: 1, flat: false }
            .record(&caps)
            .expect_err("long")
            .to_string()
            .contains("binds at most 1024")
    );
}
