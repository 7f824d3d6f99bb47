//! `winograd_weights` against its oracle, the sum over pixels.

use omnix_kernels::conv2d_weights::Conv2dWeights;
use omnix_kernels::winograd_weights::{DB, DW, WinogradWeights};
use omnix_kernels::{Caps, Gpu, Tier};
use omnix_tests::cases::winograd_weights::{cases, square};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "winograd_weights",
        software: [every_shape_matches_the_oracle, binding_limits_change_no_bit],
        once: [only_what_is_right_and_faster_goes_this_way],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

/// A band sees a part of nine frames, whatever a binding holds.
fn binding_limits_change_no_bit(gpu: &Gpu) {
    let call = square(9, [64, 60], [80, 80], 1);
    let small = with_max_binding(gpu, 17 << 19);
    let windows = |gpu: &Gpu| call.record(&gpu.caps).expect("records");
    let largest = windows(&small).iter().flat_map(|d| d.windows.clone()).filter_map(|w| w.size).max();
    assert!(largest.is_some_and(|bytes| bytes <= 17 << 19), "{largest:?}");
    assert!(windows(gpu).len() > 12, "several bands");
    let args = call.args(&gpu.caps);
    assert_eq!(results(gpu, &call, &args, &[DW, DB]), results(&small, &call, &args, &[DW, DB]));
}

fn only_what_is_right_and_faster_goes_this_way() {
    let caps = Caps { tier: Tier::Software, ..Caps::baseline() };
    let good = square(1, [80, 144], [128, 128], 1).conv;
    assert!(WinogradWeights::of(good, &caps).is_some());
    assert!(WinogradWeights::of(Conv2dWeights { frames: 99, ..good }, &caps).is_some());
    let impossible = [
        Conv2dWeights { stride: 2, ..good },
        Conv2dWeights { kernel: [1, 9], ..good },
        Conv2dWeights { frames: 0, ..good },
        Conv2dWeights { ci: 124, ..good },
        Conv2dWeights { co: 130, ..good },
        Conv2dWeights { ci: u32::MAX / 8 * 8, ..good },
    ];
    for conv in impossible {
        assert!(WinogradWeights::of(conv, &caps).is_none(), "{conv:?}");
        assert!(WinogradWeights { conv }.record(&caps).is_err(), "{conv:?}");
    }
    // Small maps, whatever their number, and narrow layers.
    for call in [square(99, [20, 20], [128, 128], 1), square(1, [400, 400], [24, 32], 1)] {
        assert!(WinogradWeights::of(call.conv, &caps).is_none(), "{call:?}");
        assert!(call.record(&caps).is_ok(), "{call:?}");
    }
    assert!(WinogradWeights::of(good, &Caps::baseline()).is_none());
    assert!(WinogradWeights { conv: good }.record(&Caps { max_binding: 1 << 20, ..caps }).is_err());
}
