//! `linear_weights` against its oracle.

use omnix_kernels::linear_weights::{DB, DW, LinearWeights};
use omnix_kernels::{Caps, Gpu, KernelError};
use omnix_tests::cases::linear_weights::{cases, spec};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "linear_weights",
        tiers: [every_variant_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit, values_that_are_not_finite_stay_near],
        once: [scratch_is_bounded, bad_specifications_are_errors],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    // Sections apart, a section in pieces, columns of dy apart.
    for (call, limits) in [
        (spec(1000, 36, 20), [16_384, 65_536]),
        (spec(700, 100, 36), [32_768, 65_536]),
        (spec(300, 13, 7), [4096, 8192]),
        (spec(130, 200, 64), [57_344, 65_536]),
    ] {
        let args = call.args(&gpu.caps);
        let whole = results(gpu, &call, &args, &[DW, DB]);
        for limit in limits {
            let small = with_max_binding(gpu, limit);
            let count = |gpu: &Gpu| call.record(&gpu.caps).expect("records").len();
            assert!(count(&small) > count(gpu), "{call:?} at {limit}");
            assert_eq!(whole, results(&small, &call, &args, &[DW, DB]), "{} {call:?} at {limit}", family(gpu));
        }
    }
}

fn values_that_are_not_finite_stay_near(gpu: &Gpu) {
    let call = spec(70, 36, 40);
    let mut args = call.args(&gpu.caps);
    let mut x = args[0].f32().to_vec();
    x[69 * 40 + 39] = f32::INFINITY;
    args[0] = omnix_tests::cases::Values::F32(x);
    let dw: Vec<f32> = results(gpu, &call, &args, &[DW])[0].iter().map(|bits| f32::from_bits(*bits)).collect();
    assert!(dw.iter().enumerate().all(|(i, v)| v.is_finite() == (i % 40 != 39)), "{}", family(gpu));
    assert!(dw.iter().all(|v| !v.is_nan()), "{}", family(gpu));
}

fn scratch_is_bounded() {
    for (m, n, k) in [(100_000, 64, 64), (1_000_000, 2, 32), (100_000, 384, 1536), (100_000, 4096, 4096)] {
        let words = spec(m, n, k).parts_words();
        assert!(words * 4 <= 16 << 20, "{m} {n} {k}: {words} words");
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    for call in [spec(0, 4, 4), spec(4, 0, 4), spec(4, 4, 0)] {
        let error = call.record(&caps).expect_err("empty");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    for call in [spec(100, 4096, 4), spec(4, 100, 4096)] {
        let error = LinearWeights { bias: false, ..call }.record(&caps).expect_err("too large");
        assert!(error.to_string().contains("binds at most 65536"), "{error}");
    }
}
