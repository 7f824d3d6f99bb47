//! `pointwise` against its oracle.

use omnix_kernels::Gpu;
use omnix_kernels::pointwise::{Binary, Operand, Pointwise, Unary, Y};
use omnix_tests::cases::pointwise::{binary, cases, unary};
use omnix_tests::cases::{Call as _, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, assert_close, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "pointwise",
        tiers: [every_operation_matches_the_oracle, extremes_stay_where_they_belong, splitting_at_the_binding_limit_changes_no_bit],
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
    }
}

fn bad_operands_are_errors() {
    let caps = &gpu().caps;
    assert!(Pointwise::binary(4, Binary::Add, Operand { div: 0, len: 4 }).record(caps).is_err());
    let error = Pointwise::unary(4, Unary::Clamp { low: 2.0, high: 1.0 }).record(caps).expect_err("wrong way round");
    assert!(error.to_string().contains("clamp to 2..1"), "{error}");
    assert!(Pointwise::unary(0, Unary::Relu).record(caps).expect("records").is_empty());
}
