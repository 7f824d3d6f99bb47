//! `traj_apply` against its oracle.

use omnix_kernels::traj_apply::{Gate, Motion, THETA, TrajApply, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::cases::traj_apply::{RELEASE as RELATIVE, Seen, cases, inputs};
use omnix_tests::cases::{Values, check_all, results};
use omnix_tests::{Rng, Trial, assert_close, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "traj_apply",
        device: [matches_the_oracle_with_every_switch, a_point_stays_where_it_is_at_its_own_time, below_the_floor_numbers_are_computed_as_written, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors_and_bad_numbers_end],
    )
}

fn compute(gpu: &Gpu, spec: &TrajApply, tau: &[f32], points: &[f32], own: u32) -> (Vec<f32>, Vec<f32>) {
    let n = spec.n as usize;
    let inputs = [Values::F32(tau.to_vec()), Values::F32(points.to_vec()), Values::U32(vec![own])];
    let outputs = [Values::Out(spec.times as usize * n * 3), Values::Out(n)];
    let args: Vec<Values> = inputs.into_iter().chain(outputs).collect();
    let got = results(gpu, &Seen { spec: *spec, own }, &args, &[Y, THETA]);
    (bytemuck::pod_collect_to_vec(&got[0]), bytemuck::pod_collect_to_vec(&got[1]))
}

fn matches_the_oracle_with_every_switch(gpu: &Gpu) {
    check_all(gpu, cases());
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
