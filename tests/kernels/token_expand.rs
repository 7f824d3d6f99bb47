//! `token_expand` against its oracle.

use omnix_kernels::token_expand::Z;
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::token_expand::{cases, spec};
use omnix_tests::cases::{check_all, computed};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "token_expand",
        tiers: [matches_the_oracle_with_and_without_each_part, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle_with_and_without_each_part(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    // Several times at once; some tokens of one time.
    for (sizes, least) in [([9, 5, 36], 2), ([3, 90, 33], 12), ([5, 11, 64], 5)] {
        for optional in [0, 4, 7] {
            let spec = spec(sizes, optional);
            assert!(spec.record(&small.caps).expect("records").len() >= least);
            assert!(computed(&small, &spec, Z) == computed(gpu, &spec, Z), "{spec:?}");
        }
    }
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for sizes in [[0, 2, 3], [2, 0, 3], [2, 3, 0], [1, 1, 1000]] {
        assert!(spec(sizes, 7).record(&caps).is_err(), "{sizes:?}");
    }
}
