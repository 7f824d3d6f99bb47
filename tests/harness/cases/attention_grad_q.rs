//! Cases of `attention_grad_q`, and inputs that `attention_grad_kv` shares.

use omnix_kernels::attention::{Attention, OUT, STATE};
use omnix_kernels::attention_grad_q::{AttentionGradQ, DQ, FACTS};
use omnix_kernels::split_heads::padded;
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::attention::{Inputs, pad, spec};
use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call over scores of this spread.
#[derive(Clone, Copy, Debug)]
pub struct SpreadQ {
    /// The attention.
    pub spec: Attention,
    /// Standard deviation of the scores.
    pub spread: f32,
    /// Whether the output and state are those of the attention. For benches, whose shapes take the oracle minutes, any will do.
    pub exact: bool,
}

/// Everything that the gradients of an attention are computed from, unpadded, on the host.
#[derive(Clone, Debug)]
pub struct GradInputs {
    /// Queries, keys and values.
    pub inputs: Inputs,
    /// Gradient of the output, `[groups · heads][nq][D]`.
    pub g: Vec<f32>,
}

impl GradInputs {
    /// Seeded inputs.
    #[must_use]
    pub fn new(spec: &Attention, spread: f32) -> Self {
        let len = (spec.groups * spec.heads * spec.nq * spec.head_dim) as usize;
        Self { inputs: Inputs::new(spec, spread), g: Rng::new(u64::from(spec.nq + spec.nk * 3)).normal(len) }
    }

    /// The padded gradient of the output.
    #[must_use]
    pub fn g_rows(&self, spec: &Attention) -> Values {
        let heads = (spec.groups * spec.heads) as usize;
        Values::F32(pad(&self.g, heads, spec.nq as usize, spec.head_dim as usize, false))
    }

    /// What the oracle of the forward pass and its softmax make of the inputs: the output, and the state as `[m, l]` rows. Rows of padding
    /// hold numbers that no gradient may depend on.
    #[must_use]
    pub fn forward(&self, spec: &Attention) -> (Vec<f32>, Vec<f32>) {
        let Inputs { q, k, v } = &self.inputs;
        let out = cpu::attention(spec, q, k, v);
        let (nq, nk, d) = (spec.nq as usize, spec.nk as usize, spec.head_dim as usize);
        let rows = padded(spec.nq) as usize;
        let heads = (spec.groups * spec.heads) as usize;
        let mut state = vec![f32::NAN; heads * rows * 2];
        for (head, i) in (0..heads).flat_map(|head| (0..nq).map(move |i| (head, i))) {
            let score = |j: usize| -> f64 {
                (0..d).map(|c| f64::from(q[(head * nq + i) * d + c]) * f64::from(k[(head * nk + j) * d + c])).sum()
            };
            let scores: Vec<f64> = (0..nk).map(score).collect();
            let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let at = (head * rows + i) * 2;
            state[at] = top as f32;
            state[at + 1] = scores.iter().map(|s| (s - top).exp()).sum::<f64>() as f32;
        }
        (out, state)
    }
}

/// Facts `[heads][2][nq]` as the kernel lays them out; padded queries have a top that no score reaches.
#[must_use]
pub fn pad_facts(spec: &Attention, facts: &[f32]) -> Vec<f32> {
    let (nq, rows) = (spec.nq as usize, padded(spec.nq) as usize);
    facts
        .chunks(nq)
        .enumerate()
        .flat_map(|(line, known)| {
            let rest = if line % 2 == 0 { 1e30 } else { 0.0 };
            known.iter().copied().chain(std::iter::repeat_n(rest, rows - nq))
        })
        .collect()
}

impl Call for SpreadQ {
    fn kernel(&self) -> &'static str {
        "attention_grad_q"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        AttentionGradQ { attention: self.spec }.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let spec = Attention { keep_state: true, ..self.spec };
        let made = GradInputs::new(&spec, self.spread);
        let mut args = made.inputs.args(&spec, caps);
        let (out, state) = if self.exact {
            made.forward(&spec)
        } else {
            let top_and_sum = [3.0, spec.nk as f32].repeat(spec.q_words() as usize / padded(spec.head_dim) as usize);
            (made.g.clone(), top_and_sum)
        };
        (args[usize::from(OUT.0)], args[usize::from(STATE.0)]) = (Values::F32(out), made.g_rows(&spec));
        let call = AttentionGradQ { attention: spec };
        let results = [spec.q_words(), call.facts_words(), call.turned_words()].map(|n| Values::Out(n as usize));
        args.into_iter().chain([Values::F32(state)]).chain(results).collect()
    }

    fn oracle(&self, _: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let spec = &self.spec;
        let GradInputs { inputs: Inputs { q, k, v }, g } = GradInputs::new(spec, self.spread);
        let (dq, facts) = cpu::attention_grad_q(spec, &q, &k, &v, &g);
        let heads = (spec.groups * spec.heads) as usize;
        let dq = pad(&dq, heads, spec.nq as usize, spec.head_dim as usize, false);
        vec![(DQ, Values::F32(dq)), (FACTS, Values::F32(pad_facts(spec, &facts)))]
    }

    fn limit(&self, _: &Caps, arg: Arg) -> f64 {
        match arg {
            // Padded tops are so large that nothing else counts in the norm of all facts; the others are compared in a test of their own.
            FACTS => 1e-6,
            // The gradient is 0: what is left is the rounding of two sums that are equal.
            _ if self.spec.nk == 1 => 2e-5,
            _ => bound(self.spread),
        }
    }

    fn work(&self) -> Work {
        Work::Flops(AttentionGradQ { attention: self.spec }.flops())
    }
}

/// Relative error of f32 sums. Scores of spread 40 reach 150, where f32 has steps of 1.5e-5, and a weight has the error of its score.
#[must_use]
pub fn bound(spread: f32) -> f64 {
    if spread > 10.0 { 1e-4 } else { 5e-6 }
}

/// Groups, heads, channels, queries, keys and spread: every kind of head width; one, around a vec4, a block and a tile; several windows;
/// many small heads; sharp distributions.
#[must_use]
pub fn specs() -> Vec<(Attention, f32)> {
    let widths = [2, 6, 8, 24, 32, 36, 64, 96, 98, 128].map(|d| (spec(2, 3, d, 37, 70), 1.0));
    let lengths = [(1, 1), (1, 300), (9, 3), (33, 31), (64, 32), (65, 33), (40, 256), (70, 257), (300, 9), (260, 600)];
    let lengths = lengths.map(|(nq, nk)| (spec(1, 2, 64, nq, nk), 1.0));
    let others = [(spec(9, 5, 24, 5, 40), 1.0), (spec(1, 2, 64, 20, 300), 40.0)];
    widths.into_iter().chain(lengths).chain(others).collect()
}

/// Shapes that networks have: one image and four in global attention, four in local attention, other widths of heads.
#[must_use]
pub fn shapes() -> Vec<(String, Attention)> {
    let shapes = [(1, 6, 64, 1296), (1, 6, 64, 5184), (4, 6, 64, 721), (1, 12, 32, 1296), (1, 4, 128, 1296)];
    let named = |(groups, heads, head_dim, n)| {
        (format!("{groups} groups, {heads} heads of {head_dim}, {n} keys"), spec(groups, heads, head_dim, n, n))
    };
    shapes.map(named).into()
}

/// All of [`specs`], then [`shapes`].
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = specs().into_iter().map(|(spec, spread)| Case::test(SpreadQ { spec, spread, exact: true }));
    tests
        .chain(shapes().into_iter().map(|(name, spec)| Case::bench(name, SpreadQ { spec, spread: 1.0, exact: false })))
        .collect()
}
