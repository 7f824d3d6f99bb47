//! `adamw` against its oracle.

use omnix_kernels::adamw::{AdamW, FIRST, SECOND, WEIGHTS};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::adamw::{At, TRAINING, cases};
use omnix_tests::cases::{Call as _, Values, check_all, results};
use omnix_tests::{Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "adamw",
        tiers: [matches_the_oracle, steps_are_those_of_the_definition, bad_gradients_change_nothing, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_settings_are_errors],
    )
}

const STATE: [omnix_kernels::Arg; 3] = [WEIGHTS, FIRST, SECOND];

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

/// Three steps of torch's AdamW over w = (1, −2, 0.5, 3) with the gradients w, w / 2 and −w of the first weights; learning rate 0.1, decay 0.1,
/// betas 0.9 and 0.95.
fn steps_are_those_of_the_definition(gpu: &Gpu) {
    let start = [1.0f32, -2.0, 0.5, 3.0];
    let spec = AdamW { n: 4, clip: false, ..TRAINING };
    let mut state = [start.to_vec(), vec![0.0; 4], vec![0.0; 4]];
    let (mut w, mut m, mut v) = (start.map(f64::from), [0.0f64; 4], [0.0f64; 4]);
    for (step, share) in [(1, 1.0f32), (2, 0.5), (3, -1.0)] {
        let gradient: Vec<f32> = start.iter().map(|s| share * s).collect();
        let rates = spec.rates(step, 0.1, 0.1).to_vec();
        let [weights, first, second] = state.clone().map(Values::F32);
        let args = [weights, first, second, Values::F32(gradient.clone()), Values::F32(rates), Values::Out(1)];
        let call = At { spec, step, clip: [0.0; 4] };
        let got = results(gpu, &call, &args, &STATE);
        state = [0, 1, 2].map(|i| bytemuck::pod_collect_to_vec(&got[i]));
        for i in 0..4 {
            let g = f64::from(gradient[i]);
            w[i] *= 1.0 - 0.1 * 0.1;
            m[i] = 0.9 * m[i] + 0.1 * g;
            v[i] = 0.95 * v[i] + 0.05 * g * g;
            let (m_hat, v_hat) = (m[i] / (1.0 - 0.9f64.powi(step as i32)), v[i] / (1.0 - 0.95f64.powi(step as i32)));
            w[i] -= 0.1 * m_hat / (v_hat.sqrt() + 1e-8);
        }
        let want = w.map(|v| v as f32);
        assert_close(&format!("step {step}, {}", gpu.caps.tier), &state[0], &want, 1e-6);
    }
}

fn bad_gradients_change_nothing(gpu: &Gpu) {
    for n in [7, 8] {
        let call = At { spec: AdamW { n, ..TRAINING }, step: 3, clip: [0.0, f32::NAN, 1.0, 0.0] };
        let mut args = call.args(&gpu.caps);
        args[3] = Values::F32(vec![f32::NAN; n as usize]);
        let got = results(gpu, &call, &args, &STATE);
        for (got, was) in got.iter().zip(&args) {
            assert_eq!(bytemuck::cast_slice::<u32, f32>(got), was.f32());
        }
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 2048);
    for n in [5000, 5001] {
        let call = At { spec: AdamW { n, ..TRAINING }, step: 3, clip: [0.3, 1.0, 0.0, 0.0] };
        assert!(call.record(&small.caps).expect("records").len() > 5);
        let on = |gpu: &Gpu| results(gpu, &call, &call.args(&gpu.caps), &STATE);
        assert!(on(&small) == on(gpu));
    }
}

fn impossible_settings_are_errors() {
    let caps = Caps::baseline();
    for bad in [
        AdamW { betas: [1.0, 0.9], ..TRAINING },
        AdamW { betas: [0.9, -0.1], ..TRAINING },
        AdamW { betas: [0.9, f64::NAN], ..TRAINING },
        AdamW { eps: 0.0, ..TRAINING },
        AdamW { scale: f32::INFINITY, ..TRAINING },
    ] {
        let error = bad.record(&caps).expect_err("impossible").to_string();
        assert!(error.contains("betas are from 0 to below 1"), "{error}");
    }
    assert!(AdamW { n: 0, ..TRAINING }.record(&caps).expect("records").is_empty());
}
