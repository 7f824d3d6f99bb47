//! Cases of `split_heads_grad`.

use omnix_kernels::split_heads::{HeadLayout, SplitHeads};
use omnix_kernels::split_heads_grad::{D_BIAS, D_WEIGHT, DX, SplitHeadsGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::split_heads::{forms, spec};
use super::{Call, Case, Values, Work};
use crate::Rng;

/// What stands in dx before: columns that belong to no head must keep it.
const BEFORE: f32 = 7.0;

impl Call for SplitHeadsGrad {
    fn kernel(&self) -> &'static str {
        "split_heads_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let heads = &self.heads;
        // x, weight, bias and table are those of the forward pass.
        let mut forward = super::Call::args(heads, caps);
        let table = forward.swap_remove(3);
        let (x, weight) = (forward.swap_remove(0), forward.swap_remove(1));
        let mut rng = Rng::new(u64::from(heads.tokens * 17 + heads.head_dim));
        let dy = rng.normal(heads.words() as usize);
        let dx = vec![BEFORE; (heads.groups * heads.tokens * self.dx_stride) as usize];
        let d = if heads.norm.is_some() { heads.head_dim as usize } else { 0 };
        let scratch = [self.stats_words(), self.parts_words()].map(|n| Values::Out(n as usize));
        let outputs = [Values::F32(dx), Values::Out(d), Values::Out(d)];
        [x, weight, table, Values::F32(dy)].into_iter().chain(outputs).chain(scratch).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let [x, weight, table, dy] = [0, 1, 2, 3].map(|i| args[i].f32());
        let (dx, d_weight, d_bias) = cpu::split_heads_grad(self, x, weight, table, dy, BEFORE);
        let mut wanted = vec![(DX, Values::F32(dx))];
        if self.heads.norm.is_some() {
            wanted.extend([(D_WEIGHT, Values::F32(d_weight)), (D_BIAS, Values::F32(d_bias))]);
        }
        wanted
    }

    fn limit(&self, _: &Caps, arg: Arg) -> f64 {
        match (self.heads.head_dim, arg) {
            // Of two channels the normalised ones are 1 and -1 whatever they are: the gradient is 0 but for rounding, beside numbers of 7.
            (2, DX) => 1e-4,
            _ => 3e-6,
        }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// The gradients of a call into a tensor of its heads alone.
#[must_use]
pub const fn compact(heads: SplitHeads) -> SplitHeadsGrad {
    SplitHeadsGrad { heads, dx_stride: heads.heads * heads.head_dim, dx_offset: 0 }
}

/// Groups, tokens, heads and their width: one, around a block of tokens, a part and a section, widths of every kind.
const SHAPES: [(u32, u32, u32, u32); 13] = [
    (1, 1, 1, 8),
    (1, 33, 2, 24),
    (2, 32, 3, 32),
    (3, 5, 1, 48),
    (2, 70, 6, 64),
    (1, 31, 2, 96),
    (1, 64, 1, 128),
    (1, 9, 2, 2),
    (2, 33, 3, 6),
    (1, 40, 3, 12),
    (100, 3, 2, 36),
    (1, 34, 2, 100),
    (3, 200, 1, 16),
];

/// All forms of all shapes, compact and into the columns they came from, and columns that start anywhere; then q and v of 4 images at
/// 504x280 in the small network.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (groups, tokens, heads, head_dim) in SHAPES {
        for form in forms(spec(groups, tokens, heads, head_dim)) {
            cases.push(Case::test(compact(form)));
            if form.layout == HeadLayout::Rows {
                cases.push(Case::test(SplitHeadsGrad {
                    heads: form,
                    dx_stride: form.x_stride,
                    dx_offset: form.x_offset,
                }));
            }
        }
    }
    let odd = SplitHeads { x_stride: 35, x_offset: 3, norm: Some(1e-6), rope_rows: Some(4), ..spec(2, 9, 2, 16) };
    cases.push(Case::test(SplitHeadsGrad { heads: odd, dx_stride: 37, dx_offset: 1 }));
    let v = SplitHeads { x_offset: 2 * 6 * 64, ..spec(4, 721, 6, 64) };
    let q = SplitHeads { x_offset: 0, norm: Some(1e-5), rope_rows: Some(721), scale: 0.125, ..v };
    for (name, heads) in [("q", q), ("v", v)] {
        cases.push(Case::bench(format!("{name}, 4 x 721 tokens, 6 heads of 64"), compact(heads)));
    }
    cases
}
