//! `swiglu` against its oracle.

use omnix_kernels::swiglu::{SwiGlu, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::swiglu::cases;
use omnix_tests::cases::{check_all, computed};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "swiglu",
        tiers: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [a_row_above_the_binding_limit_is_an_error],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (m, h) in [(50, 36), (129, 65), (40, 128), (300, 44)] {
        let spec = SwiGlu { m, h };
        assert!(spec.record(&small.caps).expect("records").len() > 1, "{spec:?}");
        assert_eq!(computed(gpu, &spec, Y), computed(&small, &spec, Y), "{spec:?}");
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(SwiGlu { m: 2, h: 1000 }.record(&caps).expect_err("too large").to_string().contains("binds at most 1024"));
}
