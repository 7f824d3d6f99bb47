//! `gather` against its oracle.

use omnix_kernels::gather::{Gather, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::gather::cases;
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "gather",
        tiers: [matches_the_oracle, a_table_above_the_binding_limit_is_seen_in_windows],
        once: [impossible_rows_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_table_above_the_binding_limit_is_seen_in_windows(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for [n, m, c] in [[500, 90, 36], [700, 900, 5], [9, 40, 900]] {
        let spec = Gather { n, m, c };
        assert!(spec.record(&small.caps).expect("records").len() > 4, "{spec:?}");
        let args = spec.args(&small.caps);
        assert!(results(&small, &spec, &args, &[Y]) == results(gpu, &spec, &args, &[Y]), "{spec:?}");
    }
}

fn impossible_rows_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(Gather { n: 2, m: 2, c: 1000 }.record(&caps).expect_err("wide").to_string().contains("binds at most 1024"));
    assert!(Gather { n: 0, m: 2, c: 4 }.record(&caps).is_err());
}
