//! `deform_sample_grad` against its oracle.

use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::deform_sample_grad::{DOFFSETS, DWEIGHTS, DeformSampleGrad};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::deform_sample::{Inputs, spec};
use omnix_tests::cases::deform_sample_grad::{cases, dtau};
use omnix_tests::cases::{Call as _, Values, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "deform_sample_grad",
        device: [matches_the_oracle, clamped_positions_have_no_gradient, splitting_at_the_binding_limit_changes_no_bit, what_is_not_a_number_ends],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn compute(gpu: &Gpu, spec: &DeformSample, inputs: &Inputs) -> [Vec<f32>; 2] {
    let taps = spec.n as usize * spec.taps() as usize;
    let mut args = inputs.args(spec);
    args.extend([Values::F32(dtau(spec)), Values::Out(taps * 2), Values::Out(taps)]);
    let got = results(gpu, &DeformSampleGrad(*spec), &args, &[DOFFSETS, DWEIGHTS]);
    [bytemuck::pod_collect_to_vec(&got[0]), bytemuck::pod_collect_to_vec(&got[1])]
}

fn clamped_positions_have_no_gradient(gpu: &Gpu) {
    let spec = spec([14, 14], [3, 2], 2, None);
    let mut inputs = Inputs::new(&spec);
    // x goes far outside, y stays where it is.
    inputs.offsets.chunks_exact_mut(2).for_each(|o| (o[0], o[1]) = (1e9 * o[0].signum(), 0.01));
    let [offsets, weights] = compute(gpu, &spec, &inputs);
    assert!(offsets.iter().step_by(2).all(|v| *v == 0.0));
    // Pixels of the last row are pushed out of the image.
    let inside = 13 * 14 * 12;
    assert!(offsets[..inside].iter().skip(1).step_by(2).all(|v| *v != 0.0));
    assert!(offsets[inside..].iter().skip(1).step_by(2).all(|v| *v == 0.0));
    assert!(weights.iter().all(|v| *v != 0.0));
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for spec in [spec([33, 28], [4, 3], 3, None), spec([33, 28], [4, 3], 5, Some(500))] {
        let call = DeformSampleGrad(spec);
        assert!(call.record(&small.caps).expect("records").len() > 6);
        let on = |gpu: &Gpu| results(gpu, &call, &call.args(&gpu.caps), &[DOFFSETS, DWEIGHTS]);
        assert!(on(&small) == on(gpu), "{spec:?}");
    }
}

fn what_is_not_a_number_ends(gpu: &Gpu) {
    let spec = spec([28, 14], [4, 3], 2, None);
    let mut inputs = Inputs::new(&spec);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    inputs.offsets.iter_mut().step_by(5).zip(bad.iter().cycle()).for_each(|(o, b)| *o = *b);
    inputs.weights[7] = f32::NAN;
    let [offsets, weights] = compute(gpu, &spec, &inputs);
    assert!(offsets.len() == 28 * 14 * 12 && weights.len() == 28 * 14 * 6);
    assert!(offsets[14].is_nan());
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    let good = spec([14, 14], [1, 1], 1, None);
    assert!(DeformSampleGrad(good).record(&caps).is_ok());
    for bad in [
        DeformSample { n: 0, ..good },
        DeformSample { n: 5, ..good },
        DeformSample { points: 0, ..good },
        DeformSample { times: 0, ..good },
        DeformSample { hp: 80, ..good },
        DeformSample { times: 200, ..good },
    ] {
        assert!(DeformSampleGrad(bad).record(&caps).is_err(), "{bad:?}");
    }
}
