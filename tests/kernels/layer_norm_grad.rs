//! `layer_norm_grad` against its oracle.

use omnix_kernels::layer_norm_grad::{D_BIAS, D_WEIGHT, DX};
use omnix_kernels::{Caps, Gpu, KernelError};
use omnix_tests::cases::layer_norm_grad::{AroundGrad, cases, spec};
use omnix_tests::cases::{Call as _, Case, check_all, computed, results};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "layer_norm_grad",
        tiers: [every_variant_matches_the_oracle, a_common_offset_costs_no_more_than_its_rounding, splitting_at_the_binding_limit_changes_no_bit, a_single_channel_has_no_gradient],
        once: [bad_specifications_are_errors],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_common_offset_costs_no_more_than_its_rounding(gpu: &Gpu) {
    // One-pass variance would lose everything here: mean² is 10⁶ times the variance.
    check_all(gpu, [Case::test(AroundGrad { spec: spec(5, 384, true), offset: 3000.0 })]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for c in [96, 100, 33] {
        let call = AroundGrad { spec: spec(700, c, true), offset: 0.0 };
        let args = call.args(&gpu.caps);
        let whole = results(gpu, &call, &args, &[DX, D_WEIGHT, D_BIAS]);
        let small = with_max_binding(gpu, 25_600);
        assert!(call.record(&small.caps).expect("records").len() > call.record(&gpu.caps).expect("records").len());
        assert_eq!(whole, results(&small, &call, &args, &[DX, D_WEIGHT, D_BIAS]), "{} {c}", family(gpu));
    }
}

fn a_single_channel_has_no_gradient(gpu: &Gpu) {
    let dx = computed(gpu, &AroundGrad { spec: spec(40, 1, true), offset: 0.0 }, DX);
    assert!(dx.iter().all(|v| v.abs() < 1e-3), "{}: {dx:?}", family(gpu));
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let error = spec(100, 4096, true).record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
    for (m, c) in [(0, 4), (4, 0)] {
        let error = spec(m, c, true).record(&caps).expect_err("empty");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
}
