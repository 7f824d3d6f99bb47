//! `layer_norm` against its oracle.

use omnix_kernels::layer_norm::Y;
use omnix_kernels::{Activation, Caps, Gpu, KernelError};
use omnix_tests::cases::layer_norm::{Around, cases, spec};
use omnix_tests::cases::{Case, check_all, computed};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "layer_norm",
        families: [every_variant_matches_the_oracle, a_common_offset_costs_no_more_than_its_rounding, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_common_offset_costs_no_more_than_its_rounding(gpu: &Gpu) {
    // One-pass variance would lose everything here: mean² is 10⁶ times the variance.
    check_all(gpu, [Case::test(Around { spec: spec(5, 384, Activation::None, false), offset: 3000.0 })]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for c in [96, 100, 33] {
        let spec = spec(200, c, Activation::Gelu, true);
        let call = Around { spec, offset: 0.0 };
        let small = with_max_binding(gpu, 25_600);
        assert!(spec.record(&small.caps).expect("records").len() > 1);
        assert_eq!(computed(gpu, &call, Y), computed(&small, &call, Y), "{}", family(gpu));
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let error = spec(100, 4096, Activation::None, true).record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
    for (m, c) in [(0, 4), (4, 0)] {
        let error = spec(m, c, Activation::None, true).record(&caps).expect_err("empty");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
}
