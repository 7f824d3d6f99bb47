//! `resize_grad` against its oracle.

use omnix_kernels::resize::{Corners, Filter};
use omnix_kernels::resize_grad::DX;
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::resize::corners;
use omnix_tests::cases::resize_grad::{cases, spec};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, assert_close, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "resize_grad",
        tiers: [every_shape_matches_the_oracle, splitting_over_frames_and_bands_changes_no_bit, every_output_is_read_with_weight_one],
        once: [bad_specifications_are_errors],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_over_frames_and_bands_changes_no_bit(gpu: &Gpu) {
    for filter in [Filter::Bilinear, Filter::Bicubic] {
        for corners in corners() {
            // Frames apart, then bands: the last row of a map that is cut off is read by many outputs.
            for (shape, bands) in
                [([40, 9, 60, 13, 8], 20_480), ([60, 13, 33, 9, 5], 14_336), ([5, 9, 70, 11, 4], 12_544)]
            {
                let call = spec(3, shape, filter, corners);
                let whole = computed(gpu, &call, DX);
                for limit in [28_672, bands] {
                    let small = with_max_binding(gpu, limit);
                    let count = call.record(&small.caps).expect("records").len();
                    assert!(count > call.record(&gpu.caps).expect("records").len(), "{call:?} at {limit}");
                    assert_eq!(whole, computed(&small, &call, DX), "{} {call:?} at {limit}", family(gpu));
                }
            }
        }
    }
}

fn every_output_is_read_with_weight_one(gpu: &Gpu) {
    // Weights of an output sum to 1: with gradients of 1, all pixels together get the number of outputs.
    for filter in [Filter::Bilinear, Filter::Bicubic] {
        for corners in corners() {
            for shape in [[7, 9, 20, 31, 4], [30, 40, 7, 9, 1], [1, 5, 6, 1, 3]] {
                let [hi, wi, ho, wo, c] = shape.map(|n| n as usize);
                let args = [Values::F32(vec![1.0; ho * wo * c]), Values::Out(hi * wi * c)];
                let dx = computed_from(gpu, &spec(1, shape, filter, corners), &args, DX);
                let sum = dx.iter().map(|v| f64::from(*v)).sum::<f64>() as f32;
                assert_close(&format!("{} {shape:?}", family(gpu)), &[sum], &[(ho * wo * c) as f32], 1e-5);
            }
        }
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    for (shape, words) in [
        ([4, 300, 8, 600, 4], "binds at most 4096"),
        ([4, 4, 0, 4, 4], "nothing to compute"),
        ([4, 100_000, 4, 100_000, 4], "sides too long"),
    ] {
        let error = spec(1, shape, Filter::Bilinear, Corners::Align).record(&caps).expect_err("bad");
        assert!(error.to_string().contains(words), "{error}");
    }
}
