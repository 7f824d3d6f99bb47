//! Cases of `attention`.

use omnix_kernels::attention::{Attention, OUT};
use omnix_kernels::split_heads::padded;
use omnix_kernels::{Arg, Caps, Cooperative, Dispatch, KernelError, Tier, cpu};

use super::{Call, Case, Values, Work};
use crate::{Rng, as_f16};

/// A call over scores of this spread: large ones make sharp distributions, whose running maximum moves.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// The specification.
    pub spec: Attention,
    /// Standard deviation of the scores.
    pub spread: f32,
}

/// Unpadded queries, keys and values, `[groups · heads][n][D]`.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// Queries, already scaled.
    pub q: Vec<f32>,
    /// Keys.
    pub k: Vec<f32>,
    /// Values.
    pub v: Vec<f32>,
}

impl Inputs {
    /// Seeded inputs.
    #[must_use]
    pub fn new(spec: &Attention, spread: f32) -> Self {
        let mut rng = Rng::new(u64::from(spec.nq * 31 + spec.nk * 7 + spec.head_dim));
        let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
        let scale = spread / (spec.head_dim as f32).sqrt();
        let q = rng.normal(heads * spec.nq as usize * d).iter().map(|v| v * scale).collect();
        Self { q, k: rng.normal(heads * spec.nk as usize * d), v: rng.normal(heads * spec.nk as usize * d) }
    }

    /// The same as the operands of the variants of `caps` hold them.
    #[must_use]
    pub fn rounded(mut self, caps: &Caps) -> Self {
        if caps.tier == Tier::Gpu && caps.f16 {
            (self.k, self.v) = (as_f16(&self.k), as_f16(&self.v));
            if caps.cooperative.f16_16 {
                self.q = as_f16(&self.q);
            }
        }
        self
    }

    /// The kernel's arguments: padded, keys in blocks.
    #[must_use]
    pub fn args(&self, spec: &Attention, caps: &Caps) -> Vec<Values> {
        let (heads, d) = ((spec.groups * spec.heads) as usize, spec.head_dim as usize);
        let q = pad(&self.q, heads, spec.nq as usize, d, false);
        let k = pad(&self.k, heads, spec.nk as usize, d, true);
        let v = pad(&self.v, heads, spec.nk as usize, d, false);
        assert_eq!((q.len() as u64, k.len() as u64), (spec.q_words(), spec.kv_words()), "padded lengths");
        let state = (spec.state_bytes(caps) / 4) as usize;
        let outputs = [Values::Out(spec.out_words() as usize), Values::Out(state)];
        [q, k, v].map(Values::F32).into_iter().chain(outputs).collect()
    }
}

/// `[heads][n][D]` → padded rows, or padded key blocks.
#[must_use]
pub fn pad(x: &[f32], heads: usize, n: usize, d: usize, key_blocks: bool) -> Vec<f32> {
    let (n_pad, dp) = (padded(n as u32) as usize, padded(d as u32) as usize);
    let mut out = vec![0.0; heads * n_pad * dp];
    for head in 0..heads {
        for i in 0..n {
            for c in 0..d {
                let at = if key_blocks { (i / 32 * dp + c) * 32 + i % 32 } else { i * dp + c };
                out[head * n_pad * dp + at] = x[(head * n + i) * d + c];
            }
        }
    }
    out
}

/// Relative error: sums are f32; matrix units round them in their own way, and take weights as f16.
#[must_use]
pub fn bound(caps: &Caps) -> f64 {
    let gpu = caps.tier == Tier::Gpu;
    match caps.cooperative {
        Cooperative { f16_16: true, .. } if gpu && caps.f16 => 1e-3,
        Cooperative { f32_8: true, .. } if gpu => 1e-5,
        _ => 3e-6,
    }
}

impl Call for Spread {
    fn kernel(&self) -> &'static str {
        "attention"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        Inputs::new(&self.spec, self.spread).rounded(caps).args(&self.spec, caps)
    }

    fn oracle(&self, caps: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let Inputs { q, k, v } = Inputs::new(&self.spec, self.spread).rounded(caps);
        vec![(OUT, Values::F32(cpu::attention(&self.spec, &q, &k, &v)))]
    }

    fn limit(&self, caps: &Caps, _: Arg) -> f64 {
        bound(caps)
    }

    fn work(&self) -> Work {
        Work::Flops(self.spec.flops())
    }
}

/// A specification.
#[must_use]
pub const fn spec(groups: u32, heads: u32, head_dim: u32, nq: u32, nk: u32) -> Attention {
    Attention { groups, heads, head_dim, nq, nk, keep_state: false }
}

/// Every kind of head width.
#[must_use]
pub fn widths() -> Vec<Case> {
    let test = |head_dim| Case::test(Spread { spec: spec(2, 3, head_dim, 37, 70), spread: 1.0 });
    [2, 6, 8, 12, 20, 24, 32, 36, 48, 64, 96, 98, 100, 128].into_iter().map(test).collect()
}

/// One; around a vec4, a block of keys, a tile of queries; one and several uniform windows; many small heads; sharp distributions:
/// the running maximum moves, weights underflow.
#[must_use]
pub fn lengths() -> Vec<Case> {
    let lengths = [(1, 1), (1, 300), (9, 3), (33, 31), (64, 32), (65, 33), (40, 256), (70, 257), (130, 600)];
    let mut calls: Vec<Spread> =
        lengths.into_iter().map(|(nq, nk)| Spread { spec: spec(1, 2, 64, nq, nk), spread: 1.0 }).collect();
    calls.push(Spread { spec: spec(9, 5, 24, 5, 40), spread: 1.0 });
    calls.push(Spread { spec: spec(1, 2, 64, 20, 300), spread: 40.0 });
    calls.into_iter().map(Case::test).collect()
}

/// All widths and lengths; then one image, 4 images, 16 images at 504x280 in global attention, local attention of 4 images, and other
/// widths of heads.
#[must_use]
pub fn cases() -> Vec<Case> {
    let shapes = [
        (1, 6, 64, 1296),
        (1, 6, 64, 5184),
        (1, 6, 64, 11_536),
        (4, 6, 64, 721),
        (1, 12, 32, 1296),
        (1, 4, 96, 1296),
        (1, 4, 128, 1296),
    ];
    let bench = |(groups, heads, head_dim, n)| {
        let name = format!("{groups} groups, {heads} heads of {head_dim}, {n} keys");
        Case::bench(name, Spread { spec: spec(groups, heads, head_dim, n, n), spread: 1.0 })
    };
    widths().into_iter().chain(lengths()).chain(shapes.map(bench)).collect()
}
