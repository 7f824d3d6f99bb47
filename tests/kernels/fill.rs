//! `fill` against its oracle.

use omnix_kernels::fill::{Fill, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::fill::cases;
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "fill",
        tiers: [writes_what_it_is_told_and_nothing_else, splitting_at_the_binding_limit_writes_the_same_words],
        once: [nothing_to_write_and_no_room],
    )
}

fn writes_what_it_is_told_and_nothing_else(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_writes_the_same_words(gpu: &Gpu) {
    let small = with_max_binding(gpu, 1024);
    for (first, n) in [(0, 5000), (3, 5001), (400, 4000)] {
        let spec = Fill { first, n, value: 7 };
        assert!(spec.record(&small.caps).expect("records").len() > 10);
        let on = |gpu: &Gpu| results(gpu, &spec, &spec.args(&gpu.caps), &[Y]);
        assert!(on(&small) == on(gpu), "{spec:?}");
    }
}

fn nothing_to_write_and_no_room() {
    let caps = Caps { max_binding: 256, ..Caps::baseline() };
    assert!(Fill { first: 9, n: 0, value: 1 }.record(&Caps::baseline()).expect("records").is_empty());
    let error = Fill { first: 0, n: 9, value: 1 }.record(&caps).expect_err("no room").to_string();
    assert!(error.contains("binds at most 256"), "{error}");
}
