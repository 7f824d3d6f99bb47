//! `deform_sample_grad_field` against its oracle.

use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::deform_sample_grad_field::{DFIELD, DMASK, DeformSampleGradField};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::deform_sample::{Inputs, spec};
use omnix_tests::cases::deform_sample_grad_field::{args, cases};
use omnix_tests::cases::{Call as _, check_all, computed_from, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "deform_sample_grad_field",
        tiers: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit, two_runs_give_the_same_bits, what_is_not_a_number_ends],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn bits(gpu: &Gpu, call: DeformSampleGradField) -> Vec<Vec<u32>> {
    results(gpu, &call, &call.args(&gpu.caps), &[DFIELD, DMASK])
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    // Some parts at once; pieces of one part; levels of one part by themselves.
    for (spec, limit, least) in [
        (spec([70, 50], [4, 3], 1, None), 120_000, 3),
        (spec([33, 68], [4, 3], 3, None), 8192, 30),
        (spec([33, 40], [6, 5], 5, Some(1500)), 12_000, 20),
        (spec([33, 40], [6, 5], 1, Some(1500)), 2500, 20),
    ] {
        let small = with_max_binding(gpu, limit);
        let call = DeformSampleGradField(spec);
        let count = call.record(&small.caps).expect("records").len();
        assert!(count >= least, "{spec:?} took {count} dispatches");
        assert!(bits(&small, call) == bits(gpu, call), "{spec:?}");
    }
}

fn two_runs_give_the_same_bits(gpu: &Gpu) {
    let call = DeformSampleGradField(spec([70, 50], [3, 2], 2, None));
    assert!(bits(gpu, call) == bits(gpu, call));
}

fn what_is_not_a_number_ends(gpu: &Gpu) {
    let spec = spec([28, 14], [4, 3], 2, None);
    let mut inputs = Inputs::new(&spec);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    inputs.offsets.iter_mut().step_by(5).zip(bad.iter().cycle()).for_each(|(o, b)| *o = *b);
    inputs.weights[7] = f32::NAN;
    let dfield = computed_from(gpu, &DeformSampleGradField(spec), &args(&spec, &inputs), DFIELD);
    assert!(dfield.len() == 432 && dfield.iter().any(|v| v.is_nan()));
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    let good = spec([14, 14], [1, 1], 1, None);
    assert!(DeformSampleGradField(good).record(&caps).is_ok());
    for bad in [
        DeformSample { n: 0, ..good },
        DeformSample { n: 5, ..good },
        DeformSample { points: 0, ..good },
        DeformSample { times: 0, ..good },
        DeformSample { hp: 80, ..good },
        DeformSample { times: 200, ..good },
    ] {
        assert!(DeformSampleGradField(bad).record(&caps).is_err(), "{bad:?}");
    }
}
