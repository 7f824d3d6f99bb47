//! `winograd` against its oracle, the sum over taps.

use omnix_kernels::conv2d::Conv2d;
use omnix_kernels::winograd::{Winograd, Y};
use omnix_kernels::{Activation, Caps, Gpu, PackedWeights, Tier, WeightType};
use omnix_tests::cases::conv2d::full;
use omnix_tests::cases::winograd::{cases, spec as plain};
use omnix_tests::cases::{check_all, computed};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "winograd",
        software: [every_shape_matches_the_oracle, splitting_over_frames_changes_no_bit],
        once: [only_what_is_right_and_faster_goes_this_way],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_over_frames_changes_no_bit(gpu: &Gpu) {
    let spec = full(plain(9, [64, 60], 80, 80, 1), WeightType::F32, Activation::Relu);
    // A frame is 1.2 MiB, the scratch of a band 8 MiB: all nine do not go at once.
    let small = with_max_binding(gpu, 17 << 19);
    let count = |gpu: &Gpu| Winograd { conv: spec }.record(&gpu.caps).expect("records").len();
    assert!(count(&small) > count(gpu));
    let call = Winograd { conv: spec };
    assert_eq!(computed(gpu, &call, Y), computed(&small, &call, Y));
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
