//! `softmax` against its oracle.

use omnix_kernels::run::{HostArg, run};
use omnix_kernels::softmax::{Softmax, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "softmax",
        tiers: [every_shape_matches_the_oracle, infinities_do_not_spread, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn compute(gpu: &Gpu, m: u32, n: u32, x: &[f32]) -> Vec<f32> {
    let dispatches = Softmax { m, n }.record(&gpu.caps).expect("records");
    run(gpu, &dispatches, &[HostArg::F32(x), HostArg::Out(x.len())], usize::from(Y.0)).expect("runs")
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    for (m, n, spread) in [(1, 1, 1.0), (3, 7, 1.0), (64, 2, 30.0), (65, 33, 1.0), (200, 100, 300.0), (2, 3000, 4.0)] {
        let x: Vec<f32> = Rng::new(u64::from(n)).normal((m * n) as usize).iter().map(|v| v * spread).collect();
        let want = cpu::softmax((m as usize, n as usize), &x);
        assert_close(&format!("{} [{m}, {n}]", gpu.caps.tier), &compute(gpu, m, n, &x), &want, 1e-5);
    }
}

fn infinities_do_not_spread(gpu: &Gpu) {
    let never = f32::NEG_INFINITY;
    let x = [never, never, 0.0, never, f32::NAN, 1.0, -3e38, -3e38];
    let y = compute(gpu, 4, 2, &x);
    assert_eq!(&y[..4], &[0.0, 0.0, 1.0, 0.0]);
    assert_eq!(&y[6..], &[0.5, 0.5]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let x = Rng::new(5).normal(200 * 33);
    let small = with_max_binding(gpu, 10_240);
    assert_eq!(Softmax { m: 200, n: 33 }.record(&small.caps).expect("records").len(), 4);
    assert_eq!(compute(gpu, 200, 33, &x), compute(&small, 200, 33, &x));
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    assert!(Softmax { m: 0, n: 4 }.record(&caps).is_err());
    assert!(Softmax { m: 4, n: 0 }.record(&caps).is_err());
    let error = Softmax { m: 100, n: 4096 }.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
