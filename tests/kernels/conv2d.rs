//! `conv2d` against its oracle.

use omnix_kernels::conv2d::Y;
use omnix_kernels::{Activation, Caps, Cooperative, Dispatch, Gpu, WeightType};
use omnix_shaders::conv2d as shaders;
use omnix_tests::cases::conv2d::{cases, full, plain};
use omnix_tests::cases::{Case, Changed, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "conv2d",
        stand_ins: [cooperative_tiles_match_the_oracle_through_their_stand_ins],
        once: [bad_specifications_are_errors],
        families: [splitting_over_frames_and_bands_changes_no_bit, values_that_are_not_finite_stay_near, every_variant_matches_the_oracle],
    )
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn cooperative_tiles_match_the_oracle_through_their_stand_ins(gpu: &Gpu) {
    let products = Cooperative { f16_16: true, f32_8: true };
    let caps = gpu.caps.clone().with_subgroup(Some([32, 32])).with_cooperative(products);
    let (storage, chosen, stand_in) = if caps.f16 {
        (WeightType::F16, "cooperative_16_w16", &shaders::STAND_IN_16_32)
    } else {
        (WeightType::F32, "cooperative_8", &shaders::STAND_IN_8_32)
    };
    let gpu = gpu.with_caps(caps);
    let change = move |dispatch: &mut Dispatch| {
        assert_eq!(dispatch.shader.variant, chosen);
        dispatch.shader = stand_in;
    };
    let specs = [plain(2, [6, 5], 4, 8, [3, 3], 2, 1), plain(1, [9, 11], 36, 68, [3, 3], 1, 1)];
    let calls = specs.map(|spec| Changed { call: full(spec, storage, Activation::Relu), change, limit: 2e-6 });
    check_all(&gpu, calls.map(Case::test));
}

fn splitting_over_frames_and_bands_changes_no_bit(gpu: &Gpu) {
    for spec in [
        plain(5, [6, 7], 20, 36, [3, 3], 1, 1),
        plain(2, [31, 17], 12, 8, [3, 3], 2, 1),
        plain(1, [40, 9], 5, 7, [3, 3], 1, 1),
        plain(1, [33, 12], 8, 16, [3, 3], 1, 4),
    ] {
        let spec = full(spec, WeightType::F32, Activation::Silu);
        let whole = computed(gpu, &spec, Y);
        // The weights (23 KB and less) stay whole; frames of 3 to 6 KB do not go five at a time, larger ones in bands.
        for limit in [8192, 4096] {
            let small = with_max_binding(gpu, limit);
            let count = spec.record(&small.caps).expect("records").len();
            assert!(count > spec.record(&gpu.caps).expect("records").len(), "{count} dispatches");
            assert_eq!(whole, computed(&small, &spec, Y), "{} {spec:?} at {limit}", family(gpu));
        }
    }
}

fn values_that_are_not_finite_stay_near(gpu: &Gpu) {
    let spec = plain(1, [6, 6], 4, 4, [3, 3], 1, 1);
    let mut x = vec![1.0f32; 6 * 6 * 4];
    x[0] = f32::INFINITY;
    let packed = spec.weights.pack(|_, _| 1.0);
    let absent = || Values::F32(vec![0.0]);
    let args = [Values::F32(x), Values::Bytes(packed), absent(), absent(), absent(), Values::Out(6 * 6 * 4)];
    let y = computed_from(gpu, &spec, &args, Y);
    let reached = |i: usize| i / 24 < 2 && i / 4 % 6 < 2;
    assert!((0..y.len()).all(|i| y[i].is_finite() != reached(i)), "{}", family(gpu));
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    let mut spec = plain(1, [8, 8], 4, 4, [3, 3], 1, 1);
    spec.weights.k = 35;
    assert!(spec.record(&caps).expect_err("depth").to_string().contains("weights of depth 35"));
    let error = plain(1, [8, 400], 4, 4, [3, 3], 1, 1).record(&caps).expect_err("wide");
    assert!(error.to_string().contains("binds at most 4096"), "{error}");
    assert!(plain(1, [2, 2], 4, 4, [3, 3], 1, 0).record(&caps).is_err());
    assert!(plain(1, [2, 2], 4, 4, [3, 3], 0, 1).record(&caps).is_err());
}
