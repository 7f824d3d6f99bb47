//! `grad_norm` against its oracle.

use omnix_kernels::grad_norm::{Clip, Squares};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::grad_norm::{CLIP, Clipped, cases};
use omnix_tests::cases::{Call as _, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "grad_norm",
        tiers: [matches_the_oracle, what_is_not_a_number_is_told, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_bounds_are_errors],
    )
}

const ONE: Clip = Clip { max_norm: 1.0, scale: 1.0 };

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn what_is_not_a_number_is_told(gpu: &Gpu) {
    let call = Clipped { sizes: vec![3000, 5], size: 1.0, clip: ONE };
    for (gradient, at, bad) in
        [(5, 2999, f32::NAN), (5, 0, f32::INFINITY), (6, 4, f32::NAN), (6, 1, f32::NEG_INFINITY), (6, 0, 1e30)]
    {
        let mut args = call.args(&gpu.caps);
        if let Values::F32(values) = &mut args[gradient] {
            values[at] = bad;
        }
        let got = computed_from(gpu, &call, &args, CLIP);
        assert!(got[0] == 0.0 && got[2] == 1.0 && !got[1].is_finite(), "{bad} gave {got:?}");
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 16_384);
    let call = Clipped { sizes: vec![100_000, 3000, 1, 20_002], size: 0.3, clip: ONE };
    assert!(call.record(&small.caps).expect("records").len() > 30);
    assert!(computed(gpu, &call, CLIP) == computed(&small, &call, CLIP));
}

fn impossible_bounds_are_errors() {
    for (max_norm, scale) in [(0.0, 1.0), (-1.0, 1.0), (f32::NAN, 1.0), (1.0, f32::NAN), (1.0, f32::INFINITY)] {
        assert!(Clip { max_norm, scale }.record().is_err(), "{max_norm} {scale}");
    }
    let squares = Squares { n: 2000, first: 0, scale: 1.0 };
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(squares.record(&caps).expect_err("no room").to_string().contains("binds at most 1024"));
    assert!(Squares { n: 0, ..squares }.record(&Caps::baseline()).expect("records").is_empty());
}
