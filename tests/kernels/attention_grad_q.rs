//! `attention_grad_q` against its oracle, and what it takes from `attention`.

use omnix_kernels::attention::{Attention, OUT, STATE};
use omnix_kernels::attention_grad_q::{DQ, FACTS};
use omnix_kernels::split_heads::padded;
use omnix_kernels::{Caps, Gpu, KernelError, cpu};
use omnix_tests::cases::attention::{Inputs, Spread, spec};
use omnix_tests::cases::attention_grad_q::{GradInputs, SpreadQ, cases};
use omnix_tests::cases::{Call as _, check_all, computed_from, results};
use omnix_tests::{Trial, assert_close, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "attention_grad_q",
        tiers: [every_shape_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit, scores_far_below_zero_give_no_nan],
        families: [attention_keeps_its_state_for_all_rows],
        once: [bad_specifications_are_errors],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn attention_keeps_its_state_for_all_rows(gpu: &Gpu) {
    for limit in [32_768, gpu.caps.max_binding] {
        let gpu = with_max_binding(gpu, limit);
        for plain in [spec(2, 3, 24, 37, 70), spec(1, 2, 64, 70, 300), spec(1, 1, 6, 33, 40)] {
            let call = Spread { spec: Attention { keep_state: true, ..plain }, spread: 1.0 };
            let args = call.args(&gpu.caps);
            let made = results(&gpu, &call, &args, &[OUT, STATE]);
            let without = Spread { spec: plain, spread: 1.0 };
            let out: Vec<u32> =
                computed_from(&gpu, &without, &without.args(&gpu.caps), OUT).iter().map(|v| v.to_bits()).collect();
            assert_eq!(made[0], out, "{} {plain:?}: the output is the same", family(&gpu));
            // m + log l does not depend on which maximum the kernel took.
            let state: Vec<f32> = made[1].iter().map(|bits| f32::from_bits(*bits)).collect();
            let Inputs { q, k, v } = Inputs::new(&plain, 1.0).rounded(&gpu.caps);
            let (_, facts) = cpu::attention_grad_q(&plain, &q, &k, &v, &q);
            let (nq, rows) = (plain.nq as usize, padded(plain.nq) as usize);
            for head in 0..(plain.groups * plain.heads) as usize {
                let kept = &state[head * rows * 2..(head * rows + nq) * 2];
                let got: Vec<f32> = kept.chunks(2).map(|pair| pair[0] + pair[1].ln()).collect();
                let limit = if gpu.caps.cooperative.any() { 1e-4 } else { 2e-6 };
                let what = format!("{} {plain:?} head {head}", family(&gpu));
                assert_close(&what, &got, &facts[head * 2 * nq..][..nq], limit);
            }
        }
    }
}

fn facts_of(gpu: &Gpu, call: &SpreadQ) -> Vec<f32> {
    computed_from(gpu, call, &call.args(&gpu.caps), FACTS)
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let mut split = 0;
    for spec in [
        spec(4, 3, 48, 37, 70),
        spec(1, 2, 64, 200, 300),
        spec(3, 2, 24, 65, 64),
        spec(1, 2, 128, 70, 33),
        spec(2, 3, 6, 70, 300),
    ] {
        let call = SpreadQ { spec, spread: 1.0, exact: true };
        let args = call.args(&gpu.caps);
        let whole = results(gpu, &call, &args, &[DQ, FACTS]);
        for limit in [32_768, 65_536] {
            let small = with_max_binding(gpu, limit);
            let pieces = |gpu: &Gpu| call.record(&gpu.caps).expect("records").len();
            split += usize::from(pieces(&small) > pieces(gpu));
            assert_eq!(whole, results(&small, &call, &args, &[DQ, FACTS]), "{} {limit} {spec:?}", family(gpu));
        }
        // The facts of real queries, without padding's large numbers.
        let made = GradInputs::new(&spec, 1.0);
        let Inputs { q, k, v } = &made.inputs;
        let (_, want) = cpu::attention_grad_q(&spec, q, k, v, &made.g);
        let (nq, rows) = (spec.nq as usize, padded(spec.nq) as usize);
        for (got, want) in facts_of(gpu, &call).chunks(rows).zip(want.chunks(nq)) {
            assert_close(&format!("{} {spec:?}", family(gpu)), &got[..nq], want, 3e-6);
        }
    }
    assert!(split >= 6, "{}: only {split} of 10 cases were split", family(gpu));
}

fn scores_far_below_zero_give_no_nan(gpu: &Gpu) {
    // Scores of -512 each: the weight of a padded key, whose score is 0, would overflow.
    let spec = spec(1, 1, 32, 3, 5);
    let call = SpreadQ { spec, spread: 1.0, exact: true };
    let mut args = call.args(&gpu.caps);
    for (at, value, len) in [(0, -4.0, 3), (1, 4.0, 5)] {
        let mut numbers = args[at].f32().to_vec();
        let real = |i: usize| if at == 0 { i < len * 32 } else { i % 32 < len };
        numbers.iter_mut().enumerate().filter(|(i, _)| real(*i)).for_each(|(_, v)| *v = value);
        args[at] = omnix_tests::cases::Values::F32(numbers);
    }
    let state = [[-512.0f32, 5.0]; 32].concat();
    args[5] = omnix_tests::cases::Values::F32(state);
    let dq = computed_from(gpu, &call, &args, DQ);
    assert!(dq.iter().all(|v| v.is_finite()), "{}: {dq:?}", family(gpu));
    assert!(dq[3 * 32..].iter().all(|v| *v == 0.0), "{}: padding", family(gpu));
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    for spec in [spec(0, 1, 32, 1, 1), spec(1, 1, 32, 0, 1), spec(1, 1, 31, 1, 1), spec(1, 1, 130, 1, 1)] {
        let error = SpreadQ { spec, spread: 1.0, exact: true }.record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = SpreadQ { spec: spec(1, 1, 64, 9, 9), spread: 1.0, exact: true }
        .record(&caps)
        .expect_err("32 rows of 256 bytes");
    assert!(error.to_string().contains("binds at most 4096"), "{error}");
}
