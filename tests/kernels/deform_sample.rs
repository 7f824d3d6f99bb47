//! `deform_sample` against its oracle.

use omnix_kernels::deform_sample::{DeformSample, TAU};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::cases::deform_sample::{Inputs, cases, spec};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "deform_sample",
        device: [matches_the_oracle, offsets_far_outside_stop_at_the_border_where_half_the_weight_falls_on_cells, splitting_at_the_binding_limit_changes_no_bit, a_list_gives_the_bits_of_the_whole_image, what_is_not_a_number_ends],
        once: [impossible_sizes_are_errors],
    )
}

pub(crate) fn compute(gpu: &Gpu, spec: &DeformSample, inputs: &Inputs) -> Vec<f32> {
    let mut args = inputs.args(spec);
    args.push(Values::Out((spec.n * (spec.times * 9 + 1)) as usize));
    computed_from(gpu, spec, &args, TAU)
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn offsets_far_outside_stop_at_the_border_where_half_the_weight_falls_on_cells(gpu: &Gpu) {
    let spec = spec([14, 14], [3, 2], 2, None);
    let mut inputs = Inputs::new(&spec);
    inputs.offsets.iter_mut().for_each(|o| *o = 1e9 * o.signum());
    inputs.mask.fill(1.0);
    let got = compute(gpu, &spec, &inputs);
    assert_close("far offsets", &got, &cpu::deform_sample(&spec, &inputs.sampled()), 2e-6);
    // Every point lies in a corner: a quarter of the weights, which sum to 1.
    let row = spec.times as usize * 9 + 1;
    assert!(got.chunks_exact(row).all(|r| (r[row - 1] - 0.25).abs() < 1e-6));
    inputs.mask.fill(0.0);
    assert!(compute(gpu, &spec, &inputs).chunks_exact(row).all(|r| r[row - 1] == 0.0));
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for spec in [spec([33, 28], [4, 3], 3, None), spec([33, 28], [4, 3], 5, Some(500))] {
        assert!(spec.record(&small.caps).expect("records").len() > 6);
        assert!(computed(&small, &spec, TAU) == computed(gpu, &spec, TAU), "{spec:?}");
    }
}

fn a_list_gives_the_bits_of_the_whole_image(gpu: &Gpu) {
    let all = spec([33, 28], [4, 3], 3, None);
    let inputs = Inputs::new(&all);
    let whole = compute(gpu, &all, &inputs);
    let pixels = [923, 0, 33, 32, 500];
    let listed = spec([33, 28], [4, 3], 3, Some(5));
    let rows = |data: &[f32], width: usize| -> Vec<f32> {
        pixels.iter().flat_map(|p| data[*p as usize * width..][..width].to_vec()).collect()
    };
    let some = Inputs {
        offsets: rows(&inputs.offsets, 12),
        weights: rows(&inputs.weights, 6),
        pixels: pixels.to_vec(),
        ..inputs.clone()
    };
    assert!(compute(gpu, &listed, &some) == rows(&whole, 28));
}

fn what_is_not_a_number_ends(gpu: &Gpu) {
    let spec = spec([28, 14], [4, 3], 2, None);
    let mut inputs = Inputs::new(&spec);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    inputs.offsets.iter_mut().step_by(5).zip(bad.iter().cycle()).for_each(|(o, b)| *o = *b);
    inputs.weights[7] = f32::NAN;
    let got = compute(gpu, &spec, &inputs);
    assert_eq!(got.len(), 28 * 14 * 19);
    // Pixel 1 has the bad weight.
    assert!(got[19..38].iter().all(|v| v.is_nan()));
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    let good = spec([14, 14], [1, 1], 1, None);
    assert!(good.record(&caps).is_ok());
    for bad in [
        DeformSample { n: 0, ..good },
        DeformSample { n: 5, ..good },
        DeformSample { points: 0, ..good },
        DeformSample { times: 0, ..good },
        DeformSample { wp: 0, ..good },
        DeformSample { hp: 80, ..good },
        DeformSample { times: 200, ..good },
    ] {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
}
