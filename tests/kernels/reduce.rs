//! `reduce` against its oracle.

use omnix_kernels::reduce::{Reduce, ReduceOp, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "reduce",
        tiers: [every_operation_matches_the_oracle, a_maximum_of_negative_numbers_is_negative, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

const OPS: [ReduceOp; 5] = [ReduceOp::Sum, ReduceOp::Mean, ReduceOp::Max, ReduceOp::Min, ReduceOp::Std];

fn compute(gpu: &Gpu, spec: &Reduce, x: &[f32]) -> Vec<f32> {
    let args = [HostArg::F32(x), HostArg::Out((spec.outer * spec.inner) as usize)];
    run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs")
}

fn numbers(spec: &Reduce) -> Vec<f32> {
    let len = (spec.outer * spec.n * spec.inner) as usize;
    // Far from 0, so that a one-pass deviation would show.
    Rng::new(u64::from(spec.n)).normal(len).iter().map(|v| v + 20.0).collect()
}

fn every_operation_matches_the_oracle(gpu: &Gpu) {
    for (outer, n, inner) in [(1, 1, 1), (1, 1000, 1), (3, 7, 5), (65, 2, 1), (2, 33, 64), (70, 1, 3)] {
        for op in OPS {
            let spec = Reduce { outer, n, inner, op };
            let x = numbers(&spec);
            let want = cpu::reduce((outer as usize, n as usize, inner as usize), op, &x);
            assert_close(&format!("{} {spec:?}", gpu.caps.tier), &compute(gpu, &spec, &x), &want, 1e-5);
        }
    }
}

fn a_maximum_of_negative_numbers_is_negative(gpu: &Gpu) {
    let x = [-3.0, f32::NEG_INFINITY, -2.0, f32::NEG_INFINITY, 1.0, f32::INFINITY];
    let spec = |op| Reduce { outer: 3, n: 2, inner: 1, op };
    assert_eq!(compute(gpu, &spec(ReduceOp::Max), &x), [-3.0, -2.0, f32::INFINITY]);
    assert_eq!(compute(gpu, &spec(ReduceOp::Min), &x), [f32::NEG_INFINITY, f32::NEG_INFINITY, 1.0]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for op in OPS {
        // Rows of 5 x 7 numbers: no window starts at an aligned row.
        let spec = Reduce { outer: 101, n: 5, inner: 7, op };
        let x = numbers(&spec);
        let small = with_max_binding(gpu, 1024);
        assert!(spec.record(&small.caps).expect("records").len() > 10);
        assert_eq!(compute(gpu, &spec, &x), compute(&small, &spec, &x), "{op:?}");
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
