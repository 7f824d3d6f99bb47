//! `split_heads` (RoPE, q/k norm, head-major layouts) against its oracle.

use omnix_kernels::split_heads::{HeadLayout, SplitHeads, Y};
use omnix_kernels::{Caps, Gpu, KernelError};
use omnix_tests::cases::split_heads::{cases, forms, spec};
use omnix_tests::cases::{check_all, computed};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "split_heads",
        tiers: [every_shape_matches_the_oracle, padding_is_zero, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

const LAYOUTS: [HeadLayout; 2] = [HeadLayout::Rows, HeadLayout::KeyBlocks];

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn padding_is_zero(gpu: &Gpu) {
    for (layout, head_dim) in [24, 12, 6].into_iter().flat_map(|d| LAYOUTS.map(|layout| (layout, d))) {
        // A norm with a bias would show in padding that went through it.
        let spec = SplitHeads { norm: Some(1e-6), layout, ..spec(1, 33, 1, head_dim) };
        let got = computed(gpu, &spec, Y);
        let padding = got.iter().enumerate().filter(|(i, _)| {
            let (t, d) = match layout {
                HeadLayout::Rows => (i / 32, i % 32),
                HeadLayout::KeyBlocks => (i / 1024 * 32 + i % 32, i % 1024 / 32),
            };
            t >= 33 || d >= head_dim as usize
        });
        assert!(padding.clone().count() == 64 * 32 - 33 * head_dim as usize);
        assert!(padding.into_iter().all(|(_, v)| v.to_bits() == 0), "{} {head_dim} {layout:?}", gpu.caps.tier);
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for base in [spec(3, 100, 2, 24), spec(2, 70, 3, 64), SplitHeads { x_stride: 147, ..spec(1, 130, 2, 24) }] {
        for form in forms(base) {
            let whole = computed(gpu, &form, Y);
            // y of a head is 12 to 24 KiB, x of 32 tokens up to 74 KiB; a limit that splits either.
            for limit in [81_920, 262_144] {
                let small = with_max_binding(gpu, limit);
                assert_eq!(whole, computed(&small, &form, Y), "{} {limit} {form:?}", gpu.caps.tier);
            }
        }
    }
    // One head of y above the limit: split by tokens.
    let form = SplitHeads { layout: HeadLayout::KeyBlocks, ..spec(1, 300, 1, 64) };
    let small = with_max_binding(gpu, 32_768);
    assert!(form.record(&small.caps).expect("records").len() > 2);
    assert_eq!(computed(gpu, &form, Y), computed(&small, &form, Y), "{}", gpu.caps.tier);
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let good = spec(1, 40, 2, 24);
    let bad = [
        SplitHeads { tokens: 0, ..good },
        SplitHeads { head_dim: 21, ..good },
        SplitHeads { head_dim: 0, ..good },
        SplitHeads { head_dim: 22, rope_rows: Some(4), ..good },
        SplitHeads { head_dim: 130, x_stride: 9999, ..good },
        SplitHeads { x_stride: 95, ..good },
        SplitHeads { rope_rows: Some(0), ..good },
        SplitHeads { rope_rows: Some(100_000), ..good },
    ];
    for spec in bad {
        let error = spec.record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = SplitHeads { x_stride: 4096, ..good }.record(&caps).expect_err("32 rows of 16 KiB");
    assert!(matches!(error, KernelError::RowTooLarge { .. }), "{error}");
}
