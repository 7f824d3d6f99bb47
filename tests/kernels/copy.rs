//! `copy` against its oracle.

use omnix_kernels::Gpu;
use omnix_kernels::copy::Y;
use omnix_tests::cases::copy::{cases, permutation};
use omnix_tests::cases::{Call as _, Values, check_all, results};
use omnix_tests::{Trial, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "copy",
        tiers: [matches_the_oracle, splitting_at_the_binding_limit_moves_the_same_words],
        once: [nothing_to_copy_and_double_writes],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_moves_the_same_words(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (shape, order) in [
        ([1, 1, 3, 20, 36, 8], [0, 1, 4, 2, 3, 5]),
        ([1, 1, 1, 1, 1, 20_000], [0, 1, 2, 3, 4, 5]),
        ([1, 1, 1, 1, 70, 90], [0, 1, 2, 3, 5, 4]),
        ([1, 1, 1, 31, 7, 13], [0, 1, 2, 5, 4, 3]),
    ] {
        let call = permutation(shape, order);
        let count = call.record(&small.caps).expect("records").len();
        assert!(count > 4, "{shape:?} took {count} dispatches");
        let args = call.args(&small.caps);
        let want = call.oracle(&small.caps, &args);
        let got = results(&small, &call, &args, &[Y]);
        assert!(want == [(Y, Values::U32(got[0].clone()))], "{shape:?}");
    }
}

fn nothing_to_copy_and_double_writes() {
    let mut spec = permutation([1, 1, 1, 1, 4, 4], [0, 1, 2, 3, 4, 5]).spec;
    spec.dst.strides[4] = 0;
    let error = spec.record(&gpu().caps).expect_err("writes twice");
    assert!(error.to_string().contains("writes an element twice"), "{error}");
    spec.shape[5] = 0;
    assert!(spec.record(&gpu().caps).expect("records").is_empty());
}
