//! `conv2d` against its oracle.

use omnix_kernels::conv2d::{Conv2d, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Activation, Caps, Cooperative, Dispatch, Gpu, PackedWeights, WeightType, cpu};
use omnix_shaders::conv2d as shaders;
use omnix_tests::{Rng, Trial, as_f16, assert_close, family, rounds, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "conv2d",
        stand_ins: [cooperative_tiles_match_the_oracle_through_their_stand_ins],
        once: [bad_specifications_are_errors],
        families: [splitting_over_frames_and_bands_changes_no_bit, values_that_are_not_finite_stay_near, every_variant_matches_the_oracle],
    )
}

/// A plain specification with nothing optional.
pub(crate) fn plain(
    frames: u32,
    [hi, wi]: [u32; 2],
    ci: u32,
    co: u32,
    kernel: [u32; 2],
    stride: u32,
    padding: u32,
) -> Conv2d {
    let weights = PackedWeights { k: kernel[0] * kernel[1] * ci, n: co, storage: WeightType::F32 };
    Conv2d {
        frames,
        hi,
        wi,
        ci,
        kernel,
        stride,
        padding,
        weights,
        act: Activation::None,
        relu_input: false,
        bias: false,
        residual: false,
        residual2: false,
    }
}

/// With everything optional.
pub(crate) fn full(mut spec: Conv2d, storage: WeightType, act: Activation) -> Conv2d {
    spec.weights.storage = storage;
    Conv2d { act, relu_input: true, bias: true, residual: true, residual2: true, ..spec }
}

fn case(gpu: &Gpu, spec: &Conv2d) -> (Vec<f32>, Vec<f32>) {
    compute(gpu, spec, rounds(gpu), &|_| ())
}

/// Result and oracle; `round` takes an input that f16 holds exactly, `change` sees every dispatch before it runs.
fn compute(gpu: &Gpu, spec: &Conv2d, round: bool, change: &dyn Fn(&mut Dispatch)) -> (Vec<f32>, Vec<f32>) {
    let [ho, wo] = spec.output();
    let (k, co) = (spec.weights.k as usize, spec.weights.n as usize);
    let mut rng = Rng::new(k as u64 * 31 + co as u64);
    let x = rng.normal((spec.frames * spec.hi * spec.wi * spec.ci) as usize);
    let x = if round { as_f16(&x) } else { x };
    let w = as_f16(&rng.normal(k * co).iter().map(|v| v / (k as f32).sqrt()).collect::<Vec<_>>());
    let weight = |k: usize, o: usize| w[k * co + o];
    let out = (spec.frames * ho * wo) as usize * co;
    let (bias, residual, residual2) = (rng.normal(co), rng.normal(out), rng.normal(out));
    let packed = spec.weights.pack(weight);
    let args = [
        HostArg::F32(&x),
        HostArg::Bytes(&packed),
        HostArg::F32(&bias),
        HostArg::F32(&residual),
        HostArg::F32(&residual2),
        HostArg::Out(out),
    ];
    let mut dispatches = spec.record(&gpu.caps).expect("records");
    dispatches.iter_mut().for_each(change);
    let got = run(gpu, &dispatches, &args, usize::from(Y.0)).expect("runs");
    (got, cpu::conv2d(spec, &x, &weight, &bias, &residual, &residual2))
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    // One pixel, odd sizes, several column blocks, several windows of taps, parts of a tap (ci above 512 and 1024).
    let specs = [
        plain(1, [1, 1], 1, 1, [3, 3], 1, 1),
        plain(2, [5, 7], 3, 5, [3, 3], 1, 1),
        plain(2, [6, 5], 4, 8, [3, 3], 2, 1),
        plain(1, [9, 11], 32, 36, [3, 3], 1, 1),
        plain(3, [4, 5], 64, 64, [3, 3], 1, 1),
        plain(1, [7, 6], 128, 100, [3, 3], 1, 1),
        plain(1, [3, 4], 520, 8, [3, 3], 2, 1),
        plain(1, [2, 3], 1036, 4, [1, 3], 1, 0),
        plain(1, [10, 9], 12, 20, [5, 2], 3, 2),
        plain(1, [28, 29], 3, 64, [14, 14], 14, 0),
        plain(2, [3, 3], 8, 130, [1, 1], 1, 0),
        plain(1, [2, 2], 4, 4, [3, 3], 1, 3),
    ];
    for spec in &specs {
        let mut variants = vec![*spec];
        for storage in [WeightType::F32, WeightType::F16] {
            variants.push(full(*spec, storage, Activation::Relu));
        }
        if spec.ci == 32 {
            variants.push(full(*spec, WeightType::F32, Activation::Gelu));
        }
        for spec in variants {
            let (got, want) = case(gpu, &spec);
            assert_close(&format!("{} {spec:?}", family(gpu)), &got, &want, 2e-6);
        }
    }
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
    let change = |dispatch: &mut Dispatch| {
        assert_eq!(dispatch.shader.variant, chosen);
        dispatch.shader = stand_in;
    };
    for spec in [plain(2, [6, 5], 4, 8, [3, 3], 2, 1), plain(1, [9, 11], 36, 68, [3, 3], 1, 1)] {
        let spec = full(spec, storage, Activation::Relu);
        let (got, want) = compute(&gpu, &spec, storage == WeightType::F16, &change);
        assert_close(&format!("{} {spec:?}", stand_in.variant), &got, &want, 2e-6);
    }
}

fn splitting_over_frames_and_bands_changes_no_bit(gpu: &Gpu) {
    for spec in [
        plain(5, [6, 7], 20, 36, [3, 3], 1, 1),
        plain(2, [31, 17], 12, 8, [3, 3], 2, 1),
        plain(1, [40, 9], 5, 7, [3, 3], 1, 1),
        plain(1, [33, 12], 8, 16, [3, 3], 1, 4),
    ] {
        let spec = full(spec, WeightType::F32, Activation::Silu);
        let (whole, _) = case(gpu, &spec);
        // The weights (23 KB and less) stay whole; frames of 3 to 6 KB do not go five at a time, larger ones in bands.
        for limit in [8192, 4096] {
            let small = with_max_binding(gpu, limit);
            let count = spec.record(&small.caps).expect("records").len();
            assert!(count > spec.record(&gpu.caps).expect("records").len(), "{count} dispatches");
            assert_eq!(whole, case(&small, &spec).0, "{} {spec:?} at {limit}", family(gpu));
        }
    }
}

fn values_that_are_not_finite_stay_near(gpu: &Gpu) {
    let spec = plain(1, [6, 6], 4, 4, [3, 3], 1, 1);
    let mut x = vec![1.0f32; 6 * 6 * 4];
    x[0] = f32::INFINITY;
    let packed = spec.weights.pack(|_, _| 1.0);
    let absent = [0.0f32];
    let args = [
        HostArg::F32(&x),
        HostArg::Bytes(&packed),
        HostArg::F32(&absent),
        HostArg::F32(&absent),
        HostArg::F32(&absent),
        HostArg::Out(6 * 6 * 4),
    ];
    let y = run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs");
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
