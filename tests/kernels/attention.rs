//! `attention` against its oracle.

use omnix_kernels::attention::{Attention, OUT};
use omnix_kernels::{Caps, Cooperative, Dispatch, Gpu, KernelError, Tier, cpu};
use omnix_shaders::attention as shaders;
use omnix_tests::cases::attention::{Inputs, Spread, bound, lengths, spec, widths};
use omnix_tests::cases::{Changed, check_all, computed_from};
use omnix_tests::{Trial, assert_close, family, relative_error, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "attention",
        families: [every_head_width_matches_the_oracle, every_length_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit, the_place_of_a_query_changes_no_bit, padding_of_keys_has_no_weight, the_last_key_counts, a_query_that_is_not_finite_stays_alone],
        half: [f16_keys_and_values_cost_their_rounding],
        stand_ins: [cooperative_matrices_do_as_the_others_through_their_stand_ins],
        once: [windows_are_aligned_and_fit, bad_specifications_are_errors],
    )
}

type Change<'a> = &'a dyn Fn(&mut Dispatch);

fn compute(gpu: &Gpu, spec: &Attention, inputs: &Inputs) -> Vec<f32> {
    compute_by(gpu, spec, inputs, &|_| ())
}

/// With every dispatch changed by `change`.
fn compute_by(gpu: &Gpu, spec: &Attention, inputs: &Inputs, change: Change<'_>) -> Vec<f32> {
    let call = Changed { call: Spread { spec: *spec, spread: 1.0 }, change, limit: 0.0 };
    computed_from(gpu, &call, &inputs.args(spec, &gpu.caps), OUT)
}

fn every_head_width_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, widths());
}

fn every_length_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, lengths());
}

fn f16_keys_and_values_cost_their_rounding(gpu: &Gpu) {
    let spec = spec(1, 2, 64, 70, 257);
    let inputs = Inputs::new(&spec, 1.0);
    let want = cpu::attention(&spec, &inputs.q, &inputs.k, &inputs.v);
    let error = relative_error(&compute(gpu, &spec, &inputs), &want);
    assert!((1e-5..1e-3).contains(&error), "{error:.1e}");
}

/// Runs `test` for a device as one with cooperative matrices would be, with a head width and the stand-in of the variant that is
/// chosen for it: 16 x 16 x 16 where the family has f16, else 8 x 8 x 8.
fn through_stand_in(gpu: &Gpu, test: &dyn Fn(&Gpu, u32, Change<'_>)) {
    let products = Cooperative { f16_16: true, f32_8: true };
    let caps = gpu.caps.clone().with_subgroup(Some([32, 32])).with_cooperative(products);
    let (chosen, stand_in) = if gpu.caps.f16 {
        ("cooperative_16_32", &shaders::STAND_IN_16_64)
    } else {
        ("cooperative_8_32", &shaders::STAND_IN_8_16)
    };
    test(&gpu.with_caps(caps), 24, &|dispatch| {
        assert_eq!(dispatch.shader.variant, chosen);
        dispatch.shader = stand_in;
    });
}

/// One test, since a stand-in takes half a minute to compile.
fn cooperative_matrices_do_as_the_others_through_their_stand_ins(gpu: &Gpu) {
    through_stand_in(gpu, &|gpu, head_dim, change| {
        // One; odd; around a strip, a workgroup, a step of keys; sharp distributions: the maximum moves.
        for (nq, nk, spread) in [(1, 1, 1.0), (17, 7, 1.0), (65, 33, 1.0), (70, 100, 1.0), (20, 130, 40.0)] {
            let spec = spec(1, 2, head_dim, nq, nk);
            let inputs = Inputs::new(&spec, spread).rounded(&gpu.caps);
            let want = cpu::attention(&spec, &inputs.q, &inputs.k, &inputs.v);
            let got = compute_by(gpu, &spec, &inputs, change);
            assert_close(&format!("{} {spec:?} spread {spread}", family(gpu)), &got, &want, bound(&gpu.caps));
        }
        let spec = spec(1, 2, head_dim, 40, 140);
        let mut inputs = Inputs::new(&spec, 3.0);
        let whole = compute_by(gpu, &spec, &inputs, change);
        let small = with_max_binding(gpu, 16_384);
        assert!(small.caps.max_binding < spec.kv_words() * 4 / u64::from(spec.heads), "several windows a head");
        assert_eq!(whole, compute_by(&small, &spec, &inputs, change), "{head_dim}: windows");
        // A row whose maximum grows often rescales the sums of its neighbours by 1; one that is not finite stays alone.
        let (row, d) = (9 * head_dim as usize, head_dim as usize);
        for spoil in [30.0, f32::NAN] {
            inputs.q[row..row + d].iter_mut().for_each(|q| *q *= spoil);
            let got = compute_by(gpu, &spec, &inputs, change);
            for (at, (got, whole)) in got.iter().zip(&whole).enumerate() {
                if at / (2 * d) != 9 || at % (2 * d) >= d {
                    assert_eq!(got, whole, "{head_dim}: {spoil} {at}");
                } else if spoil.is_nan() {
                    assert!(got.is_nan(), "{head_dim}: {at}");
                }
            }
        }
    });
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let mut split = 0;
    // Groups apart, heads apart, queries apart, and keys in windows (baseline and GPU variants).
    for spec in [
        spec(4, 3, 48, 37, 70),
        spec(1, 2, 64, 200, 300),
        spec(3, 2, 24, 65, 64),
        spec(1, 2, 128, 70, 33),
        spec(2, 3, 6, 70, 300),
    ] {
        let inputs = Inputs::new(&spec, 3.0);
        let whole = compute(gpu, &spec, &inputs);
        for limit in [32_768, 49_152, 65_536] {
            let small = with_max_binding(gpu, limit);
            let pieces = |gpu: &Gpu| spec.record(&gpu.caps).expect("records").len();
            split += usize::from(pieces(&small) > pieces(gpu));
            assert_eq!(whole, compute(&small, &spec, &inputs), "{} {limit} {spec:?}", family(gpu));
        }
    }
    assert!(split >= 6, "{}: only {split} of 15 cases were split", family(gpu));
}

fn the_place_of_a_query_changes_no_bit(gpu: &Gpu) {
    let whole_spec = spec(1, 2, 64, 45, 100);
    let inputs = Inputs::new(&whole_spec, 3.0);
    let whole = compute(gpu, &whole_spec, &inputs);
    for skip in [1, 6, 30] {
        let rest = whole_spec.nq as usize - skip;
        let q = inputs.q.chunks(45 * 64).flat_map(|head| &head[skip * 64..]).copied().collect();
        let later = Inputs { q, k: inputs.k.clone(), v: inputs.v.clone() };
        let got = compute(gpu, &spec(1, 2, 64, rest as u32, 100), &later);
        assert_eq!(got, whole[skip * 128..], "{} {skip}", family(gpu));
    }
}

fn padding_of_keys_has_no_weight(gpu: &Gpu) {
    // All scores far below 0: a padded key (score 0) would take all the weight.
    let spec = spec(1, 1, 32, 3, 5);
    let inputs = Inputs { q: vec![-4.0; 3 * 32], k: vec![4.0; 5 * 32], v: vec![1.0; 5 * 32] };
    let got = compute(gpu, &spec, &inputs);
    assert_close(&family(gpu), &got, &[1.0; 96], 1e-6);
}

fn a_query_that_is_not_finite_stays_alone(gpu: &Gpu) {
    let spec = spec(1, 2, 32, 20, 40);
    let mut inputs = Inputs::new(&spec, 1.0);
    let clean = compute(gpu, &spec, &inputs);
    // Query 9 of head 1.
    inputs.q[(20 + 9) * 32 + 5] = f32::NAN;
    let got = compute(gpu, &spec, &inputs);
    for (at, (got, clean)) in got.iter().zip(&clean).enumerate() {
        if at / 64 == 9 && at % 64 >= 32 {
            assert!(got.is_nan(), "{} {at}", family(gpu));
        } else {
            assert_eq!(got, clean, "{} {at}", family(gpu));
        }
    }
}

fn the_last_key_counts(gpu: &Gpu) {
    for nk in [1, 4, 31, 32, 33, 257, 300] {
        let spec = spec(2, 1, 64, 5, nk);
        let (rows, d) = (2 * nk as usize, 64);
        // All weight goes to the last key of each group, whose value is unlike the others.
        let last = |at: usize| at / d % nk as usize == nk as usize - 1;
        let k = (0..rows * d).map(|at| if last(at) { 4.0 } else { -4.0 }).collect();
        let v = (0..rows * d).map(|at| if last(at) { (at % d) as f32 - 7.0 } else { 1000.0 }).collect();
        let inputs = Inputs { q: vec![1.0; 2 * 5 * d], k, v };
        let want: Vec<f32> = (0..2 * 5 * d).map(|at| (at % d) as f32 - 7.0).collect();
        for limit in [32_768, gpu.caps.max_binding] {
            let got = compute(&with_max_binding(gpu, limit), &spec, &inputs);
            assert_close(&format!("{} {nk} keys, bindings of {limit}", family(gpu)), &got, &want, 1e-6);
        }
    }
}

fn windows_are_aligned_and_fit() {
    for caps in [Caps::baseline(), Caps::lavapipe(), Caps::baseline().with_tier(Tier::Gpu)] {
        let dispatches = spec(1, 16, 64, 100_000, 100_000).record(&caps).expect("records");
        for window in dispatches.iter().flat_map(|dispatch| &dispatch.windows) {
            assert_eq!(window.offset % caps.align, 0);
            assert!(window.size.is_none_or(|size| size <= caps.max_binding));
        }
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    for spec in [
        spec(0, 1, 32, 1, 1),
        spec(1, 0, 32, 1, 1),
        spec(1, 1, 32, 0, 1),
        spec(1, 1, 32, 1, 0),
        spec(1, 1, 0, 1, 1),
        spec(1, 1, 31, 1, 1),
        spec(1, 1, 130, 1, 1),
    ] {
        let error = spec.record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = spec(1, 16, 64, 64, 64).record(&caps).expect_err("32 rows of 4 KiB");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
