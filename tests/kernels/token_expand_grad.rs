//! `token_expand_grad` against its oracle.

use omnix_kernels::token_expand_grad::{DQ, DROW, DTIME};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::token_expand_grad::{cases, spec};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "token_expand_grad",
        tiers: [matches_the_oracle_with_and_without_each_part, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle_with_and_without_each_part(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    // Several times at once; blocks of one time; some tokens of a block.
    for (sizes, least) in [([9, 5, 36], 6), ([3, 200, 5], 9), ([3, 90, 33], 12), ([5, 150, 64], 20)] {
        for optional in [0, 4, 7] {
            let spec = spec(sizes, optional);
            let count = spec.record(&small.caps).expect("records").len();
            assert!(count >= least, "{spec:?} took {count} dispatches");
            let on = |gpu: &Gpu| results(gpu, &spec, &spec.args(&gpu.caps), &[DQ, DROW, DTIME]);
            assert!(on(&small) == on(gpu), "{spec:?}");
        }
    }
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for sizes in [[0, 2, 3], [2, 0, 3], [2, 3, 0], [1, 1, 1000]] {
        assert!(spec(sizes, 7).record(&caps).is_err(), "{sizes:?}");
    }
}
