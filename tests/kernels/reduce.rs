//! `reduce` against its oracle.

use omnix_kernels::reduce::{LONGEST, Reduce, ReduceOp, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::reduce::{OPS, cases};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "reduce",
        tiers: [every_operation_matches_the_oracle, a_maximum_of_negative_numbers_is_negative, long_sums_are_exact_to_a_few_bits, splitting_at_the_binding_limit_changes_no_bit, splitting_long_axes_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn every_operation_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn a_maximum_of_negative_numbers_is_negative(gpu: &Gpu) {
    let x = [-3.0, f32::NEG_INFINITY, -2.0, f32::NEG_INFINITY, 1.0, f32::INFINITY];
    let args = [Values::F32(x.to_vec()), Values::Out(3), Values::Out(0), Values::Out(0)];
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

/// One sum in order would be off by a thousandth.
fn long_sums_are_exact_to_a_few_bits(gpu: &Gpu) {
    let n = 3_000_000;
    let spec = Reduce { outer: 1, n, inner: 1, op: ReduceOp::Mean };
    let [parts, more] = spec.scratch().map(|words| Values::Out(words as usize));
    let args = [Values::F32(vec![0.1; n as usize]), Values::Out(1), parts, more];
    let got = computed_from(gpu, &spec, &args, Y)[0];
    assert!((got - 0.1).abs() < 1e-7, "{got}");
}

fn splitting_long_axes_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for (outer, n, inner, least) in [
        // Blocks of a row, of columns, rows of outer that fit by ones; elements of a block; columns of an element.
        (1, 300_000, 1, 150),
        (3, 5000, 1, 9),
        (1, 3000, 5, 8),
        (2, 1100, 3, 4),
        (1, 1100, 70, 40),
        (1, 30, 90, 2),
        (2, 3, 2500, 10),
        (1, 1030, 2000, 1030),
    ] {
        for op in [ReduceOp::Sum, ReduceOp::Mean, ReduceOp::Max, ReduceOp::Min] {
            let spec = Reduce { outer, n, inner, op };
            let count = spec.record(&small.caps).expect("records").len();
            assert!(count >= least, "{spec:?} took {count} dispatches");
            assert!(computed(gpu, &spec, Y) == computed(&small, &spec, Y), "{spec:?}");
        }
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    for (outer, n, inner) in [(0, 1, 1), (1, 0, 1), (1, 1, 0)] {
        assert!(Reduce { outer, n, inner, op: ReduceOp::Sum }.record(&caps).is_err());
    }
    let error = Reduce { outer: 2, n: 20_000, inner: 1, op: ReduceOp::Std }.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
    let caps = Caps { max_binding: 2048, ..caps };
    let error = Reduce { outer: 1, n: LONGEST + 1, inner: 1, op: ReduceOp::Sum }.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 2048"), "{error}");
}
