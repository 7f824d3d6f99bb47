//! Cases of `split_heads`.

use omnix_kernels::split_heads::{HeadLayout, SplitHeads, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for SplitHeads {
    fn kernel(&self) -> &'static str {
        "split_heads"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.tokens * 31 + self.head_dim));
        let d = self.head_dim as usize;
        let x = rng.normal(self.groups as usize * self.tokens as usize * self.x_stride as usize);
        let (weight, bias) = (rng.normal(d), rng.normal(d));
        let mut table = vec![0.0f32; self.rope_rows.unwrap_or(1) as usize * d];
        for row in table.chunks_mut(d) {
            for j in 0..d / 2 {
                (row[d / 2 + j], row[j]) = (rng.uniform() * 6.0).sin_cos();
            }
        }
        let tensors = [x, weight, bias, table].map(Values::F32);
        tensors.into_iter().chain([Values::Out(self.words() as usize)]).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let [x, weight, bias, table] = [0, 1, 2, 3].map(|i| args[i].f32());
        vec![(Y, Values::F32(cpu::split_heads(self, x, Some((weight, bias)), Some(table))))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// The middle third of the columns as rows, with nothing optional.
#[must_use]
pub fn spec(groups: u32, tokens: u32, heads: u32, head_dim: u32) -> SplitHeads {
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

/// Plain, q (norm, RoPE, scale) and k (norm, RoPE, key blocks) forms of a shape.
#[must_use]
pub fn forms(base: SplitHeads) -> [SplitHeads; 5] {
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

/// Groups, tokens, heads and their width: one, around a block of tokens, widths of every kind.
const SHAPES: [(u32, u32, u32, u32); 15] = [
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

/// All forms of all shapes, and columns that start anywhere; then q, k and v of 4 images at 504x280 in the small network.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (groups, tokens, heads, head_dim) in SHAPES {
        cases.extend(forms(spec(groups, tokens, heads, head_dim)).map(Case::test));
    }
    let odd = SplitHeads { x_stride: 35, x_offset: 3, norm: Some(1e-6), rope_rows: Some(4), ..spec(2, 9, 2, 16) };
    cases.push(Case::test(odd));
    let v = SplitHeads { x_offset: 2 * 6 * 64, ..spec(4, 721, 6, 64) };
    let q = SplitHeads { x_offset: 0, norm: Some(1e-5), rope_rows: Some(721), scale: 0.125, ..v };
    let k = SplitHeads { x_offset: 6 * 64, layout: HeadLayout::KeyBlocks, ..q };
    for (name, spec) in [("q", q), ("k", k), ("v", v)] {
        cases.push(Case::bench(format!("{name}, 4 x 721 tokens, 6 heads of 64"), spec));
    }
    cases
}
