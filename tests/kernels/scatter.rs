//! `scatter` against its oracle.

use omnix_kernels::scatter::{Scatter, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::scatter::cases;
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "scatter",
        tiers: [matches_the_oracle, a_target_above_the_binding_limit_is_seen_in_windows],
        once: [a_row_above_the_binding_limit_is_an_error],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_target_above_the_binding_limit_is_seen_in_windows(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for [n, m, c] in [[500, 90, 36], [900, 700, 5], [40, 9, 900]] {
        let spec = Scatter { n, m, c };
        assert!(spec.record(&small.caps).expect("records").len() > 4, "{spec:?}");
        let args = spec.args(&small.caps);
        assert!(results(&small, &spec, &args, &[Y]) == results(gpu, &spec, &args, &[Y]), "{spec:?}");
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(Scatter { n: 2, m: 2, c: 1000 }.record(&caps).is_err());
    assert!(Scatter { n: 0, m: 2, c: 4 }.record(&caps).expect("records").is_empty());
}
