//! `conv2d_weights` against its oracle.

use omnix_kernels::conv2d_weights::{DB, DW};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::conv2d_weights::{cases, spec};
use omnix_tests::cases::{Call as _, Values, check_all, results};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "conv2d_weights",
        tiers: [every_variant_matches_the_oracle, splitting_over_rows_changes_no_bit, values_that_no_tap_reaches_do_not_count],
        once: [scratch_is_bounded, bad_specifications_are_errors],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_over_rows_changes_no_bit(gpu: &Gpu) {
    for call in [
        spec(5, [16, 17], [12, 8], [3, 3], 1, 1),
        spec(2, [61, 37], [4, 8], [3, 3], 2, 1),
        spec(1, [90, 19], [5, 7], [3, 3], 1, 1),
        spec(1, [53, 22], [4, 16], [3, 3], 1, 4),
    ] {
        let args = call.args(&gpu.caps);
        let whole = results(gpu, &call, &args, &[DW, DB]);
        for limit in [16_384, 8192] {
            let small = with_max_binding(gpu, limit);
            let count = |gpu: &Gpu| call.record(&gpu.caps).expect("records").len();
            assert!(count(&small) > count(gpu), "{call:?} at {limit}");
            assert_eq!(whole, results(&small, &call, &args, &[DW, DB]), "{} {call:?} at {limit}", family(gpu));
        }
    }
}

fn values_that_no_tap_reaches_do_not_count(gpu: &Gpu) {
    // A stride of 2 over 6 columns: the kernel of one tap reads every other pixel.
    let call = spec(1, [6, 6], [4, 4], [1, 1], 2, 0);
    let mut x = vec![1.0f32; 6 * 6 * 4];
    x[4] = f32::NAN;
    let dy = vec![1.0; 3 * 3 * 4];
    let parts = call.parts_words() as usize;
    let args = [Values::F32(x), Values::F32(dy), Values::Out(16), Values::Out(4), Values::Out(parts)];
    let dw: Vec<f32> = results(gpu, &call, &args, &[DW])[0].iter().map(|bits| f32::from_bits(*bits)).collect();
    assert_eq!(dw, [9.0; 16], "{}", family(gpu));
    // An infinite gradient at the left border: taps that lie outside of the map there stay finite.
    let call = spec(1, [3, 9], [4, 4], [3, 3], 1, 1);
    let mut dy = vec![1.0f32; 3 * 9 * 4];
    dy[9 * 4] = f32::INFINITY;
    let parts = call.parts_words() as usize;
    let args =
        [Values::F32(vec![1.0; 3 * 9 * 4]), Values::F32(dy), Values::Out(144), Values::Out(4), Values::Out(parts)];
    let dw: Vec<f32> = results(gpu, &call, &args, &[DW])[0].iter().map(|bits| f32::from_bits(*bits)).collect();
    assert!(
        (0..144).all(|i| dw[i].is_finite() == (i / 36 > 0 || i % 3 == 0) && !dw[i].is_nan()),
        "{} {dw:?}",
        family(gpu)
    );
}

fn scratch_is_bounded() {
    for call in [
        spec(64, [280, 504], [128, 64], [3, 3], 1, 1),
        spec(64, [280, 504], [32, 32], [3, 3], 1, 1),
        spec(64, [20, 36], [1024, 256], [3, 3], 1, 1),
        spec(64, [280, 504], [32, 2], [1, 1], 1, 0),
    ] {
        let (words, weights) = (call.parts_words(), u64::from(9 * call.ci * call.co));
        assert!(words * 4 <= (16 << 20) + weights * 4, "{call:?}: {words} words");
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    for (call, words) in [
        (spec(1, [8, 400], [4, 4], [3, 3], 1, 1), "binds at most 4096"),
        (spec(1, [8, 8], [16, 16], [3, 3], 1, 1), "binds at most 4096"),
        (spec(1, [2, 2], [4, 4], [3, 3], 1, 0), "nothing to compute"),
        (spec(1, [2, 2], [4, 4], [3, 3], 0, 1), "nothing to compute"),
        (spec(0, [8, 8], [4, 4], [3, 3], 1, 1), "nothing to compute"),
    ] {
        let error = call.record(&caps).expect_err("bad");
        assert!(error.to_string().contains(words), "{error}");
    }
}
