//! `field_scatter` against its oracle.

use omnix_kernels::field_scatter::FIELD;
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::field_scatter::{cases, spec};
use omnix_tests::cases::{check_all, computed};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "field_scatter",
        device: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for (spec, least) in [(spec(5, 2, 7, 30, 9), 2), (spec(3, 11, 20, 100, 9), 15), (spec(9, 9, 30, 30, 9), 12)] {
        assert!(spec.record(&small.caps).expect("records").len() >= least, "{spec:?}");
        assert!(computed(&small, &spec, FIELD) == computed(gpu, &spec, FIELD), "{spec:?}");
    }
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for bad in
        [spec(0, 1, 1, 4, 9), spec(1, 0, 1, 4, 9), spec(1, 1, 0, 4, 9), spec(1, 1, 5, 4, 9), spec(1, 1, 1, 99, 9)]
    {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
}
