//! `split_heads_grad` (RoPE, q/k norm) against its oracle.

use omnix_kernels::split_heads::{HeadLayout, SplitHeads};
use omnix_kernels::split_heads_grad::{D_BIAS, D_WEIGHT, DX, SplitHeadsGrad};
use omnix_kernels::{Caps, Gpu, KernelError};
use omnix_tests::cases::split_heads::{forms, spec};
use omnix_tests::cases::split_heads_grad::{cases, compact};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "split_heads_grad",
        tiers: [every_shape_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let mut split = 0;
    for base in [
        spec(3, 100, 2, 24),
        spec(2, 70, 3, 64),
        SplitHeads { x_stride: 147, ..spec(1, 130, 2, 24) },
        spec(1, 700, 3, 32),
        spec(90, 7, 2, 12),
    ] {
        for form in forms(base).into_iter().filter(|form| form.layout == HeadLayout::Rows) {
            let call = compact(form);
            let args = call.args(&gpu.caps);
            let wanted: &[_] = if form.norm.is_some() { &[DX, D_WEIGHT, D_BIAS] } else { &[DX] };
            let whole = results(gpu, &call, &args, wanted);
            for limit in [163_840, 262_144] {
                let small = with_max_binding(gpu, limit);
                let count = |gpu: &Gpu| call.record(&gpu.caps).expect("records").len();
                split += usize::from(count(&small) > count(gpu));
                assert_eq!(whole, results(&small, &call, &args, wanted), "{} {limit} {form:?}", gpu.caps.tier);
            }
        }
    }
    assert!(split >= 10, "{}: only {split} of 30 cases were split", gpu.caps.tier);
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let good = spec(1, 40, 2, 24);
    let bad = [
        SplitHeads { tokens: 0, ..good },
        SplitHeads { head_dim: 21, ..good },
        SplitHeads { head_dim: 22, rope_rows: Some(4), ..good },
        SplitHeads { x_stride: 95, ..good },
        SplitHeads { rope_rows: Some(0), ..good },
    ];
    for heads in bad {
        let error = compact(heads).record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = SplitHeadsGrad { heads: good, dx_stride: 50, dx_offset: 3 }.record(&caps).expect_err("narrow");
    assert!(error.to_string().contains("dx has 50 columns"), "{error}");
    let error = compact(SplitHeads { x_stride: 4096, ..good }).record(&caps).expect_err("32 rows of 16 KiB");
    assert!(matches!(error, KernelError::RowTooLarge { .. }), "{error}");
}
