//! `split_heads` (RoPE, q/k norm, head-major layouts) against its oracle.

use omnix_kernels::run::{HostArg, run};
use omnix_kernels::split_heads::{HeadLayout, SplitHeads, Y};
use omnix_kernels::{Caps, Gpu, KernelError, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "split_heads",
        tiers: [every_shape_matches_the_oracle, padding_is_zero, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

const LAYOUTS: [HeadLayout; 2] = [HeadLayout::Rows, HeadLayout::KeyBlocks];

fn spec(groups: u32, tokens: u32, heads: u32, head_dim: u32) -> SplitHeads {
    let (x_stride, x_offset) = (3 * heads * head_dim, heads * head_dim);
    SplitHeads {
        groups,
        tokens,
        heads,
        head_dim,
        x_stride,
        x_offset,
        norm: None,
        rope_rows: None,
        scale: 1.0,
        layout: HeadLayout::Rows,
    }
}

fn case(gpu: &Gpu, spec: &SplitHeads) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Rng::new(u64::from(spec.tokens * 31 + spec.head_dim));
    let d = spec.head_dim as usize;
    let x = rng.normal(spec.groups as usize * spec.tokens as usize * spec.x_stride as usize);
    let (weight, bias) = (rng.normal(d), rng.normal(d));
    let rows = spec.rope_rows.unwrap_or(1) as usize;
    let mut table = vec![0.0f32; rows * d];
    for row in table.chunks_mut(d) {
        for j in 0..d / 2 {
            (row[d / 2 + j], row[j]) = (rng.uniform() * 6.0).sin_cos();
        }
    }
    let out = spec.words() as usize;
    let args = [HostArg::F32(&x), HostArg::F32(&weight), HostArg::F32(&bias), HostArg::F32(&table), HostArg::Out(out)];
    let got = run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs");
    (got, cpu::split_heads(spec, &x, Some((&weight, &bias)), Some(&table)))
}

/// Plain, q (norm, RoPE, scale) and k (norm, RoPE, key blocks) forms of a shape.
fn forms(base: SplitHeads) -> [SplitHeads; 5] {
    // RoPE needs pairs in both halves of a head.
    let rope = |rows| base.head_dim.is_multiple_of(4).then_some(rows);
    let q = SplitHeads { norm: Some(1e-5), rope_rows: rope(base.tokens), scale: 0.125, ..base };
    [
        base,
        q,
        SplitHeads { layout: HeadLayout::KeyBlocks, ..q },
        SplitHeads { norm: None, rope_rows: rope(7), layout: HeadLayout::KeyBlocks, ..base },
        SplitHeads { rope_rows: None, ..q },
    ]
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    let shapes = [
        (1, 1, 1, 8),
        (1, 33, 2, 24),
        (2, 32, 3, 32),
        (3, 5, 1, 48),
        (2, 70, 6, 64),
        (1, 31, 2, 96),
        (1, 64, 1, 128),
        (2, 3, 2, 72),
        (1, 9, 2, 2),
        (2, 33, 3, 6),
        (1, 40, 3, 12),
        (1, 5, 2, 20),
        (2, 3, 2, 36),
        (1, 34, 2, 100),
        (1, 34, 1, 126),
    ];
    for (groups, tokens, heads, head_dim) in shapes {
        for form in forms(spec(groups, tokens, heads, head_dim)) {
            let (got, want) = case(gpu, &form);
            assert_close(&format!("{} {form:?}", gpu.caps.tier), &got, &want, 1e-6);
        }
    }
    // Columns that start anywhere.
    let odd = SplitHeads { x_stride: 35, x_offset: 3, norm: Some(1e-6), rope_rows: Some(4), ..spec(2, 9, 2, 16) };
    let (got, want) = case(gpu, &odd);
    assert_close(&format!("{} {odd:?}", gpu.caps.tier), &got, &want, 1e-6);
}

fn padding_is_zero(gpu: &Gpu) {
    for (layout, head_dim) in [24, 12, 6].into_iter().flat_map(|d| LAYOUTS.map(|layout| (layout, d))) {
        // A norm with a bias would show in padding that went through it.
        let spec = SplitHeads { norm: Some(1e-6), layout, ..spec(1, 33, 1, head_dim) };
        let (got, _) = case(gpu, &spec);
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
            let (whole, _) = case(gpu, &form);
            // y of a head is 12 to 24 KiB, x of 32 tokens up to 74 KiB; a limit that splits either.
            for limit in [81_920, 262_144] {
                let small = with_max_binding(gpu, limit);
                let (split, _) = case(&small, &form);
                assert_eq!(whole, split, "{} {limit} {form:?}", gpu.caps.tier);
            }
        }
    }
    // One head of y above the limit: split by tokens.
    let form = SplitHeads { layout: HeadLayout::KeyBlocks, ..spec(1, 300, 1, 64) };
    let small = with_max_binding(gpu, 32_768);
    assert!(form.record(&small.caps).expect("records").len() > 2);
    assert_eq!(case(gpu, &form).0, case(&small, &form).0, "{}", gpu.caps.tier);
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
