//! `pointwise` against its oracle.

use omnix_kernels::pointwise::{Binary, Operand, Pointwise, Unary, Y};
use omnix_kernels::{Gpu, cpu};
use omnix_tests::cases::pointwise::{UNARY, binary, cases, gradient, select, unary};
use omnix_tests::cases::{Call as _, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, assert_close, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "pointwise",
        tiers: [every_operation_matches_the_oracle, extremes_stay_where_they_belong, gradients_of_extremes_stay_where_they_belong, masks_keep_what_is_not_a_number_out, powers_of_negative_numbers, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_operands_are_errors],
    )
}

fn every_operation_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn extremes_stay_where_they_belong(gpu: &Gpu) {
    let a = [-1e30f32, -200.0, -100.0, -20.0, 0.0, 20.0, 100.0, 200.0];
    let args = [Values::F32(a.to_vec()), Values::F32(vec![0.0]), Values::Out(8)];
    let on = |op: Unary| computed_from(gpu, &unary(8, op), &args, Y);
    let gelu = on(Unary::Gelu);
    assert_eq!(gelu, [0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 100.0, 200.0], "{}", gpu.caps.tier);
    let softplus = on(Unary::Softplus);
    assert!(softplus[..3].iter().all(|v| *v < 1e-38) && softplus[5..] == [20.0, 100.0, 200.0], "{softplus:?}");
    let tail = f64::from(softplus[3]) / (-20.0f64).exp();
    assert!((tail - 1.0).abs() < 1e-5, "softplus(-20) is off by a factor of {tail}");
    assert_eq!(on(Unary::Tanh)[7], 1.0);
    assert_eq!(on(Unary::Sigmoid)[0], 0.0);
    assert_eq!(on(Unary::Relu)[..5], [0.0; 5]);
    assert_eq!(on(Unary::Below { limit: 20.0 }), [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
}

fn gradients_of_extremes_stay_where_they_belong(gpu: &Gpu) {
    let a = [-1e30f32, -200.0, -100.0, -20.0, 0.0, 20.0, 100.0, 200.0];
    let args = [Values::F32(a.to_vec()), Values::F32(vec![2.0; 8]), Values::Out(8), Values::F32(Vec::new())];
    let on = |op: Unary| computed_from(gpu, &gradient(8, op), &args, Y);
    assert_eq!(on(Unary::Gelu), [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0], "{}", gpu.caps.tier);
    let silu = on(Unary::Silu);
    assert!(silu[..3].iter().all(|v| v.abs() < 1e-30) && silu[5..].iter().all(|v| (v - 2.0).abs() < 1e-6), "{silu:?}");
    for op in [Unary::Sigmoid, Unary::Tanh] {
        let got = on(op);
        assert!(got.iter().all(|v| v.is_finite()) && got[0] == 0.0 && got[7] == 0.0, "{op:?}: {got:?}");
    }
    let softplus = on(Unary::Softplus);
    assert!(softplus[0] == 0.0 && softplus[4] == 1.0 && softplus[5..] == [2.0; 3], "{softplus:?}");
    assert_eq!(on(Unary::Relu), [0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0]);
    assert_eq!(on(Unary::Abs), [-2.0, -2.0, -2.0, -2.0, 0.0, 2.0, 2.0, 2.0]);
    assert_eq!(on(Unary::Clamp { low: -20.0, high: 20.0 }), [0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0, 0.0]);
    let clamped = on(Unary::ExpClamped { low: -100.0, high: 0.0 });
    assert!(clamped[..2] == [0.0; 2] && clamped[4] == 2.0 && clamped[5..] == [0.0; 3], "{clamped:?}");
}

/// What a product with 0 would let through.
fn masks_keep_what_is_not_a_number_out(gpu: &Gpu) {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0, f32::NAN, f32::INFINITY, -2.0, 3.0];
    let mask = [0.0, -0.0, 0.0, 1.0, 0.0, 0.0, f32::NAN, 0.0];
    let other: Vec<f32> = (10..18).map(|v| v as f32).collect();
    for n in [7, 8] {
        let part = |values: &[f32]| Values::F32(values[..n].to_vec());
        let args = [part(&bad), part(&mask), Values::Out(n), part(&other)];
        let size = n as u32;
        let by = Operand::same(size);
        let kept = computed_from(gpu, &binary(size, Binary::Keep, by), &args, Y);
        assert_eq!(kept, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -2.0, 0.0][..n]);
        assert_eq!(
            computed_from(gpu, &select(size, by), &args, Y),
            [10.0, 11.0, 12.0, 1.0, 14.0, 15.0, -2.0, 17.0][..n]
        );
        // The mask is dropped where `bad` is not 0, which NaN is not.
        let swapped = [part(&other), part(&bad), Values::Out(n), part(&other)];
        assert_eq!(computed_from(gpu, &binary(size, Binary::Drop, by), &swapped, Y), [0.0; 8][..n]);
        let finite = computed_from(gpu, &unary(size, Unary::IsFinite), &args, Y);
        assert_eq!(finite, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0][..n], "{}", gpu.caps.tier);
        let equal = computed_from(gpu, &binary(size, Binary::Equal, by), &[part(&bad), part(&bad), Values::Out(n)], Y);
        assert_eq!(equal, [0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0][..n]);
    }
}

fn powers_of_negative_numbers(gpu: &Gpu) {
    let a = [-2.0f32, -1.0, 0.0, 2.0, -0.5, 3.0, 1.0, -3.0];
    let args = [Values::F32(a.to_vec()), Values::F32(vec![1.0; 8]), Values::Out(8), Values::F32(Vec::new())];
    for exponent in [0.0, 1.0, 2.0, 3.0, -1.0, 1.5] {
        let op = Unary::Power { exponent };
        for (call, want) in [
            (unary(8, op), cpu::unary as fn(Unary, f64) -> f64),
            (gradient(8, op), cpu::unary_slope as fn(Unary, f64) -> f64),
        ] {
            for (got, a) in computed_from(gpu, &call, &args, Y).iter().zip(a) {
                let want = want(op, f64::from(a)) as f32;
                let near = want.is_finite() && (got - want).abs() <= 4e-6 * want.abs();
                let near = near || *got == want || got.is_nan() && want.is_nan();
                assert!(near, "{a} to the power {exponent} or its slope: {got}, not {want} ({})", gpu.caps.tier);
            }
        }
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 2048);
    // Those of 1000 and 999 have a b above the limit that repeats.
    for (n, by) in [
        (5000, Operand::same(5000)),
        (5001, Operand::same(5001)),
        (5000, Operand::row(40)),
        (4999, Operand::row(37)),
        (5000, Operand::column(50, 100)),
        (5000, Operand::column(125, 40)),
        (8000, Operand::column(1000, 8)),
        (5000, Operand::row(1000)),
        (4990, Operand::row(999)),
    ] {
        let call = binary(n, Binary::Mul, by);
        assert!(call.record(&small.caps).expect("records").len() > 5);
        let (whole, split) = (computed(gpu, &call, Y), computed(&small, &call, Y));
        assert_eq!(whole, split, "{n} {by:?}");
        let (_, want) = call.oracle(&gpu.caps, &call.args(&gpu.caps)).remove(0);
        assert_close(&format!("{n} {by:?}"), &whole, want.f32(), 1e-6);
        for call in [binary(n, Binary::Keep, by), select(n, by)] {
            assert!(computed(gpu, &call, Y) == computed(&small, &call, Y), "{call:?}");
        }
    }
    for op in UNARY {
        for call in [unary(5001, op), gradient(5001, op), gradient(5000, op)] {
            assert!(computed(gpu, &call, Y) == computed(&small, &call, Y), "{call:?}");
        }
    }
}

fn bad_operands_are_errors() {
    let caps = &gpu().caps;
    assert!(Pointwise::binary(4, Binary::Add, Operand { div: 0, len: 4 }).record(caps).is_err());
    let error = Pointwise::unary(4, Unary::Clamp { low: 2.0, high: 1.0 }).record(caps).expect_err("wrong way round");
    assert!(error.to_string().contains("clamp to 2..1"), "{error}");
    assert!(Pointwise::gradient(4, Unary::Clamp { low: 2.0, high: 1.0 }).record(caps).is_err());
    assert!(Pointwise::select(4, Operand { div: 1, len: 0 }).record(caps).is_err());
    assert!(Pointwise::gradient(0, Unary::Relu).record(caps).expect("records").is_empty());
    assert!(Pointwise::unary(0, Unary::Relu).record(caps).expect("records").is_empty());
}
