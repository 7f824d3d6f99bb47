//! `winograd` against its oracle, the sum over taps.

use omnix_kernels::conv2d::Conv2d;
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::winograd::{Winograd, Y, transform};
use omnix_kernels::{Activation, Caps, Gpu, PackedWeights, Tier, WeightType, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

use crate::conv2d;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "winograd",
        software: [every_shape_matches_the_oracle, splitting_over_frames_changes_no_bit],
        once: [only_what_is_right_and_faster_goes_this_way],
    )
}

fn plain(frames: u32, size: [u32; 2], ci: u32, co: u32, padding: u32) -> Conv2d {
    conv2d::plain(frames, size, ci, co, [3, 3], 1, padding)
}

fn full(spec: Conv2d, act: Activation) -> Conv2d {
    conv2d::full(spec, WeightType::F32, act)
}

/// Numbers of a convolution: x, weights, bias, residuals.
struct Numbers {
    x: Vec<f32>,
    w: Vec<f32>,
    bias: Vec<f32>,
    residuals: [Vec<f32>; 2],
}

impl Numbers {
    fn of(conv: &Conv2d) -> Self {
        let [ho, wo] = conv.output();
        let (k, co) = (conv.weights.k as usize, conv.weights.n as usize);
        let mut rng = Rng::new(k as u64 * 31 + co as u64);
        let out = (conv.frames * ho * wo) as usize * co;
        Self {
            x: rng.normal((conv.frames * conv.hi * conv.wi * conv.ci) as usize),
            w: rng.normal(k * co).iter().map(|v| v / (k as f32).sqrt()).collect(),
            bias: rng.normal(co),
            residuals: [rng.normal(out), rng.normal(out)],
        }
    }

    fn weight(&self, conv: &Conv2d, k: usize, o: usize) -> f32 {
        self.w[k * conv.weights.n as usize + o]
    }
}

/// What the device makes of it.
fn compute(gpu: &Gpu, conv: &Conv2d, numbers: &Numbers) -> Vec<f32> {
    let spec = Winograd { conv: *conv };
    let ci = conv.ci as usize;
    let transformed =
        |k: usize, o: usize| transform(std::array::from_fn(|tap| numbers.weight(conv, tap * ci + k % ci, o)))[k / ci];
    let args = [
        HostArg::F32(&numbers.x),
        HostArg::Bytes(&spec.weights().pack(transformed)),
        HostArg::F32(&numbers.bias),
        HostArg::F32(&numbers.residuals[0]),
        HostArg::F32(&numbers.residuals[1]),
        HostArg::Out(numbers.residuals[0].len()),
        HostArg::Out(spec.scratch() as usize),
    ];
    run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs")
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    // Odd sizes, several frames, maps of one tile's width, several blocks and a part of one, all paddings, several bands.
    for spec in [
        plain(1, [1, 1], 8, 4, 1),
        plain(1, [16, 16], 32, 32, 1),
        plain(3, [17, 19], 40, 68, 1),
        plain(1, [300, 1], 32, 36, 1),
        plain(2, [18, 20], 64, 100, 0),
        plain(1, [15, 18], 128, 40, 2),
        plain(1, [5, 7], 520, 36, 1),
        plain(2, [70, 67], 64, 64, 1),
    ] {
        for spec in [spec, full(spec, Activation::Relu), full(spec, Activation::None)] {
            let numbers = Numbers::of(&spec);
            let weight = |k: usize, o: usize| numbers.weight(&spec, k, o);
            let [residual, residual2] = &numbers.residuals;
            let want = cpu::winograd(&Winograd { conv: spec }, &numbers.x, &weight, &numbers.bias, residual, residual2);
            let got = compute(gpu, &spec, &numbers);
            assert_close(&format!("{spec:?}"), &got, &want, 4e-6);
        }
    }
}

fn splitting_over_frames_changes_no_bit(gpu: &Gpu) {
    let spec = full(plain(9, [64, 60], 80, 80, 1), Activation::Relu);
    // A frame is 1.2 MiB, the scratch of a band 8 MiB: all nine do not go at once.
    let small = with_max_binding(gpu, 17 << 19);
    let count = |gpu: &Gpu| Winograd { conv: spec }.record(&gpu.caps).expect("records").len();
    assert!(count(&small) > count(gpu));
    let numbers = Numbers::of(&spec);
    assert_eq!(compute(gpu, &spec, &numbers), compute(&small, &spec, &numbers));
}

fn only_what_is_right_and_faster_goes_this_way() {
    let caps = Caps { tier: Tier::Software, ..Caps::baseline() };
    let good = plain(1, [80, 144], 128, 128, 1);
    assert!(Winograd::of(good, &caps).is_some());
    assert!(Winograd::of(Conv2d { frames: 99, ..good }, &caps).is_some());
    let weights = |storage| PackedWeights { storage, ..good.weights };
    let impossible = [
        Conv2d { stride: 2, ..good },
        Conv2d { kernel: [1, 9], ..good },
        Conv2d { frames: 0, ..good },
        Conv2d { weights: weights(WeightType::F16), ..good },
        Conv2d { act: Activation::Gelu, ..good },
        plain(1, [80, 144], 124, 128, 1),
        plain(1, [80, 144], 128, 130, 1),
    ];
    for conv in impossible {
        assert!(Winograd::of(conv, &caps).is_none(), "{conv:?}");
        assert!(Winograd { conv }.record(&caps).is_err(), "{conv:?}");
    }
    // Small maps, whatever their number, and narrow layers.
    for conv in [plain(99, [20, 20], 128, 128, 1), plain(1, [400, 400], 24, 32, 1)] {
        assert!(Winograd::of(conv, &caps).is_none(), "{conv:?}");
        assert!(Winograd { conv }.record(&caps).is_ok(), "{conv:?}");
    }
    assert!(Winograd::of(good, &Caps::baseline()).is_none());
    assert!(Winograd { conv: good }.record(&Caps { max_binding: 1 << 20, ..caps }).is_err());
}
