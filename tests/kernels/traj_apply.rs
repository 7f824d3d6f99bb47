//! `traj_apply` against its oracle.

use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::traj_apply::{Gate, Motion, THETA, TrajApply, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "traj_apply",
        device: [matches_the_oracle_with_every_switch, a_point_stays_where_it_is_at_its_own_time, below_the_floor_numbers_are_computed_as_written, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors_and_bad_numbers_end],
    )
}

const RELATIVE: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };

/// Every combination of the switches.
pub(crate) fn motions() -> Vec<Motion> {
    let gates = [Gate::None, Gate::Hard(0.3), Gate::Blend];
    [true, false].iter().flat_map(|r| gates.map(|gate| Motion { relative: *r, min_norm: 1e-3, gate })).collect()
}

/// tau near the identity with scores in 0..1, and points.
fn inputs(spec: &TrajApply) -> (Vec<f32>, Vec<f32>) {
    let (n, row) = (spec.n as usize, spec.times as usize * 9 + 1);
    let mut rng = Rng::new(u64::from(spec.n + spec.times));
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    let mut tau: Vec<f32> =
        rng.normal(n * row).iter().enumerate().map(|(i, v)| identity[i % row % 9] + 0.4 * v).collect();
    tau.iter_mut().skip(row - 1).step_by(row).for_each(|theta| *theta = rng.uniform());
    (tau, rng.normal(n * 3))
}

fn compute(gpu: &Gpu, spec: &TrajApply, tau: &[f32], points: &[f32], own: u32) -> (Vec<f32>, Vec<f32>) {
    let n = spec.n as usize;
    let out = [HostArg::Out(spec.times as usize * n * 3), HostArg::Out(n)];
    let slices =
        upload(gpu, &[HostArg::F32(tau), HostArg::F32(points), HostArg::U32(&[own]), out[0], out[1]]).expect("uploads");
    execute(gpu, &spec.record(&gpu.caps).expect("records"), &slices).expect("runs");
    (read(gpu, &slices[usize::from(Y.0)]).expect("reads"), read(gpu, &slices[usize::from(THETA.0)]).expect("reads"))
}

fn matches_the_oracle_with_every_switch(gpu: &Gpu) {
    for motion in motions() {
        for (n, times, own) in [(1, 1, 0), (7, 3, 2), (65, 4, 1), (300, 2, 0)] {
            let spec = TrajApply { n, times, motion };
            let (tau, points) = inputs(&spec);
            let (y, theta) = compute(gpu, &spec, &tau, &points, own);
            let (want_y, want_theta) = cpu::traj_apply(&spec, &tau, &points, own as usize);
            assert_close(&format!("{spec:?}"), &y, &want_y, 1e-6);
            assert_eq!(theta, want_theta);
        }
    }
}

fn a_point_stays_where_it_is_at_its_own_time(gpu: &Gpu) {
    let spec = TrajApply { n: 40, times: 3, motion: Motion { gate: Gate::None, ..RELATIVE } };
    let (tau, points) = inputs(&spec);
    let (y, _) = compute(gpu, &spec, &tau, &points, 1);
    assert_close("own time", &y[120..240], &points, 1e-6);
}

fn below_the_floor_numbers_are_computed_as_written(gpu: &Gpu) {
    let spec = TrajApply { n: 4, times: 1, motion: Motion { relative: false, gate: Gate::None, ..RELATIVE } };
    let mut tau = vec![0.0; 40];
    for (i, row) in tau.chunks_exact_mut(10).enumerate() {
        (row[0], row[4], row[6]) = (i as f32 * 4e-4, 2e-3, i as f32);
    }
    let points = Rng::new(1).normal(12);
    let (y, _) = compute(gpu, &spec, &tau, &points, 0);
    assert_close("floor", &y, &cpu::traj_apply(&spec, &tau, &points, 0).0, 1e-6);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (n, times) in [(90, 4), (33, 30), (700, 2)] {
        let spec = TrajApply { n, times, motion: RELATIVE };
        let (tau, points) = inputs(&spec);
        assert!(spec.record(&small.caps).expect("records").len() > 3);
        assert!(compute(&small, &spec, &tau, &points, 1) == compute(gpu, &spec, &tau, &points, 1), "{spec:?}");
    }
}

fn impossible_sizes_are_errors_and_bad_numbers_end() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for (n, times) in [(0, 1), (1, 0), (1, 40)] {
        assert!(TrajApply { n, times, motion: RELATIVE }.record(&caps).is_err());
    }
    // An own time past the end, and NaN, do no harm.
    let spec = TrajApply { n: 3, times: 2, motion: RELATIVE };
    let (mut tau, points) = inputs(&spec);
    tau[18] = 1.0;
    tau[0] = f32::NAN;
    let (y, theta) = compute(gpu(), &spec, &tau, &points, 77);
    assert!(y[0].is_nan() && theta[0] == 1.0 && y[3..].iter().skip(9).all(|v| v.is_finite()));
}
