//! `traj_apply_grad` against its oracle.

use omnix_kernels::traj_apply::{Gate, Motion};
use omnix_kernels::traj_apply_grad::{DPOINTS, DTAU, TrajApplyGrad};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::traj_apply_grad::{Seen, TRAINING, cases};
use omnix_tests::cases::{Call as _, Case, check_all, computed, results};
use omnix_tests::{Trial, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "traj_apply_grad",
        device: [matches_the_oracle_with_every_switch, below_either_floor_the_divisor_is_constant, a_closed_gate_lets_the_score_learn_alone, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors_and_bad_numbers_end],
    )
}

fn matches_the_oracle_with_every_switch(gpu: &Gpu) {
    check_all(gpu, cases());
}

/// The first six numbers of a time; the rest of it is a translation of 1, 2, 3, and the score is 0.7.
fn tau(times: &[[f32; 6]]) -> Vec<f32> {
    let nine = times.iter().flat_map(|six| six.iter().copied().chain([1.0, 2.0, 3.0]));
    nine.chain([0.7]).collect()
}

fn below_either_floor_the_divisor_is_constant(gpu: &Gpu) {
    let turned = [0.8, 0.6, 0.1, -0.5, 0.9, 0.3];
    for low in [
        // The first norm, the second (b along a), both, and numbers that are all 0.
        [3e-4, 2e-4, -1e-4, 0.4, 1.0, 0.1],
        [1.0, 0.0, 0.0, 2.0, 3e-4, 2e-4],
        [1e-4, 3e-4, 0.0, 2e-4, 1e-4, 5e-4],
        [0.0; 6],
    ] {
        for (times, own) in [([low, turned], 0), ([low, turned], 1), ([low, low], 1)] {
            let spec = TrajApplyGrad { n: 1, times: 2, motion: TRAINING, theta: true };
            check_all(gpu, [Case::test(Seen { spec, own, tau: Some(tau(&times)) })]);
        }
    }
}

fn a_closed_gate_lets_the_score_learn_alone(gpu: &Gpu) {
    let motion = Motion { gate: Gate::Hard(2.0), ..TRAINING };
    let call = Seen { spec: TrajApplyGrad { n: 70, times: 3, motion, theta: false }, own: 1, tau: None };
    let dtau = computed(gpu, &call, DTAU);
    for row in dtau.chunks_exact(28) {
        assert!(row[..27].iter().all(|v| *v == 0.0) && row[27] != 0.0, "{row:?}");
    }
    // What stands still goes on as it came.
    let args = call.args(&gpu.caps);
    let dy = args[3].f32();
    let dx = computed(gpu, &call, DPOINTS);
    assert!(dx.iter().enumerate().all(|(i, v)| *v == dy[i] + dy[210 + i] + dy[420 + i]));
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (n, times) in [(90, 4), (33, 30), (700, 2)] {
        for gate in [Gate::Hard(0.5), Gate::Blend] {
            let spec = TrajApplyGrad { n, times, motion: Motion { gate, ..TRAINING }, theta: true };
            let call = Seen { spec, own: 1, tau: None };
            assert!(call.record(&small.caps).expect("records").len() > 3);
            let on = |gpu: &Gpu| results(gpu, &call, &call.args(&gpu.caps), &[DTAU, DPOINTS]);
            assert!(on(&small) == on(gpu), "{spec:?}");
        }
    }
}

fn impossible_sizes_are_errors_and_bad_numbers_end() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for (n, times) in [(0, 1), (1, 0), (1, 40)] {
        assert!(TrajApplyGrad { n, times, motion: TRAINING, theta: true }.record(&caps).is_err());
    }
    // An own time past the end, and NaN, do no harm.
    let spec = TrajApplyGrad { n: 3, times: 2, motion: TRAINING, theta: true };
    let mut call = Seen { spec, own: 1, tau: None };
    let mut tau = call.args(&gpu().caps)[0].f32().to_vec();
    tau[0] = f32::NAN;
    (call.tau, call.own) = (Some(tau), 77);
    let dtau = computed(gpu(), &call, DTAU);
    assert!(dtau[..19].iter().any(|v| v.is_nan()) && dtau[19..].iter().all(|v| v.is_finite()));
}
