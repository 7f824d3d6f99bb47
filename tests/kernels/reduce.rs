//! `reduce` against its oracle.

use omnix_kernels::reduce::{Reduce, ReduceOp, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::reduce::{OPS, cases};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "reduce",
        tiers: [every_operation_matches_the_oracle, a_maximum_of_negative_numbers_is_negative, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn every_operation_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_maximum_of_negative_numbers_is_negative(gpu: &Gpu) {
    let x = [-3.0, f32::NEG_INFINITY, -2.0, f32::NEG_INFINITY, 1.0, f32::INFINITY];
    let args = [Values::F32(x.to_vec()), Values::Out(3)];
    let on = |op| computed_from(gpu, &Reduce { outer: 3, n: 2, inner: 1, op }, &args, Y);
    assert_eq!(on(ReduceOp::Max), [-3.0, -2.0, f32::INFINITY]);
    assert_eq!(on(ReduceOp::Min), [f32::NEG_INFINITY, f32::NEG_INFINITY, 1.0]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for op in OPS {
        // Rows of 5 x 7 numbers: no window starts at an aligned row.
        let spec = Reduce { outer: 101, n: 5, inner: 7, op };
        let small = with_max_binding(gpu, 1024);
        assert!(spec.record(&small.caps).expect("records").len() > 10);
        assert_eq!(computed(gpu, &spec, Y), computed(&small, &spec, Y), "{op:?}");
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    for (outer, n, inner) in [(0, 1, 1), (1, 0, 1), (1, 1, 0)] {
        assert!(Reduce { outer, n, inner, op: ReduceOp::Sum }.record(&caps).is_err());
    }
    let error = Reduce { outer: 2, n: 20_000, inner: 1, op: ReduceOp::Sum }.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
