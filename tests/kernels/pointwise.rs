//! `pointwise` against its oracle.

use omnix_kernels::pointwise::{Binary, Operand, Pointwise, Unary, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "pointwise",
        tiers: [unary_operations_match_the_oracle, extremes_stay_where_they_belong, binary_operations_broadcast, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_operands_are_errors],
    )
}

fn compute(gpu: &Gpu, spec: &Pointwise, a: &[f32], b: &[f32]) -> Vec<f32> {
    let args = [HostArg::F32(a), HostArg::F32(b), HostArg::Out(spec.n as usize)];
    run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs")
}

fn unary_operations_match_the_oracle(gpu: &Gpu) {
    let all = [
        Unary::Relu,
        Unary::Neg,
        Unary::Abs,
        Unary::Square,
        Unary::Reciprocal,
        Unary::ScaleShift { s: 0.3, t: -2.0 },
        Unary::Clamp { low: -0.5, high: 1.5 },
        Unary::Sqrt,
        Unary::Below { limit: 0.3 },
        Unary::Gelu,
        Unary::Silu,
        Unary::Sigmoid,
        Unary::Softplus,
        Unary::Exp,
        Unary::Log,
        Unary::ExpClamped { low: -2.0, high: 1.0 },
        Unary::Tanh,
    ];
    for n in [1u32, 7, 64, 300, 4100, 4104] {
        let mut rng = Rng::new(n.into());
        for op in all {
            let mut a: Vec<f32> = rng.normal(n as usize).iter().map(|v| v * 4.0).collect();
            if matches!(op, Unary::Sqrt | Unary::Log) {
                a.iter_mut().for_each(|v| *v = v.abs() + 1e-3);
            }
            let spec = Pointwise::unary(n, op);
            let want = cpu::pointwise(&spec, &a, &[]);
            let got = compute(gpu, &spec, &a, &[0.0]);
            assert_close(&format!("{} {op:?} of {n}", gpu.caps.tier), &got, &want, 2e-6);
        }
    }
}

fn extremes_stay_where_they_belong(gpu: &Gpu) {
    let a = [-1e30f32, -200.0, -100.0, -20.0, 0.0, 20.0, 100.0, 200.0];
    let gelu = compute(gpu, &Pointwise::unary(8, Unary::Gelu), &a, &[0.0]);
    assert_eq!(gelu, [0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 100.0, 200.0], "{}", gpu.caps.tier);
    let on = |op: Unary| compute(gpu, &Pointwise::unary(8, op), &a, &[0.0]);
    let softplus = on(Unary::Softplus);
    assert!(softplus[..3].iter().all(|v| *v < 1e-38) && softplus[5..] == [20.0, 100.0, 200.0], "{softplus:?}");
    let tail = f64::from(softplus[3]) / (-20.0f64).exp();
    assert!((tail - 1.0).abs() < 1e-5, "softplus(-20) is off by a factor of {tail}");
    assert_eq!(on(Unary::Tanh)[7], 1.0);
    assert_eq!(on(Unary::Sigmoid)[0], 0.0);
    assert_eq!(on(Unary::Relu)[..5], [0.0; 5]);
    assert_eq!(on(Unary::Below { limit: 20.0 }), [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
}

fn binary_operations_broadcast(gpu: &Gpu) {
    let all = [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Max, Binary::Min];
    for (m, c) in [(1, 1), (3, 5), (7, 4), (5, 96), (33, 12), (64, 130), (300, 28), (90, 48)] {
        let n = m * c;
        let mut rng = Rng::new(u64::from(n));
        let operands = [Operand::same(n), Operand::row(c), Operand::column(m, c), Operand::single()];
        for (op, by) in all.iter().flat_map(|op| operands.map(|by| (*op, by))) {
            let a = rng.normal(n as usize);
            let b: Vec<f32> = rng.normal(by.len as usize).iter().map(|v| v + 0.1f32.copysign(*v)).collect();
            let spec = Pointwise::binary(n, op, by);
            let want = cpu::pointwise(&spec, &a, &b);
            let got = compute(gpu, &spec, &a, &b);
            assert_close(&format!("{} {op:?} {m}x{c} by {by:?}", gpu.caps.tier), &got, &want, 1e-6);
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
        let mut rng = Rng::new(n.into());
        let (a, b) = (rng.normal(n as usize), rng.normal(by.len as usize));
        let spec = Pointwise::binary(n, Binary::Mul, by);
        assert!(spec.record(&small.caps).expect("records").len() > 5);
        let want = cpu::pointwise(&spec, &a, &b);
        let (whole, split) = (compute(gpu, &spec, &a, &b), compute(&small, &spec, &a, &b));
        assert_close(&format!("{n} {by:?}"), &whole, &want, 1e-6);
        assert_eq!(whole, split, "{n} {by:?}");
    }
}

fn bad_operands_are_errors() {
    let caps = &gpu().caps;
    assert!(Pointwise::binary(4, Binary::Add, Operand { div: 0, len: 4 }).record(caps).is_err());
    let error = Pointwise::unary(4, Unary::Clamp { low: 2.0, high: 1.0 }).record(caps).expect_err("wrong way round");
    assert!(error.to_string().contains("clamp to 2..1"), "{error}");
    assert!(Pointwise::unary(0, Unary::Relu).record(caps).expect("records").is_empty());
}
