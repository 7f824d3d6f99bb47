//! `softmax` against its oracle.

use omnix_kernels::softmax::{Softmax, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::softmax::{Spread, cases};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "softmax",
        tiers: [every_shape_matches_the_oracle, infinities_do_not_spread, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn infinities_do_not_spread(gpu: &Gpu) {
    let never = f32::NEG_INFINITY;
    let x = [never, never, 0.0, never, f32::NAN, 1.0, -3e38, -3e38];
    let call = Spread { spec: Softmax { m: 4, n: 2 }, spread: 1.0 };
    let y = computed_from(gpu, &call, &[Values::F32(x.to_vec()), Values::Out(8)], Y);
    assert_eq!(&y[..4], &[0.0, 0.0, 1.0, 0.0]);
    assert_eq!(&y[6..], &[0.5, 0.5]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let call = Spread { spec: Softmax { m: 200, n: 33 }, spread: 1.0 };
    let small = with_max_binding(gpu, 10_240);
    assert_eq!(call.spec.record(&small.caps).expect("records").len(), 4);
    assert_eq!(computed(gpu, &call, Y), computed(&small, &call, Y));
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    assert!(Softmax { m: 0, n: 4 }.record(&caps).is_err());
    assert!(Softmax { m: 4, n: 0 }.record(&caps).is_err());
    let error = Softmax { m: 100, n: 4096 }.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
