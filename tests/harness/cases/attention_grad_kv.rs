//! Cases of `attention_grad_kv`.

use omnix_kernels::attention::Attention;
use omnix_kernels::attention_grad_kv::{AttentionGradKv, DK, DV};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::attention::{Inputs, pad};
use super::attention_grad_q::{GradInputs, bound, pad_facts, shapes, specs};
use super::{Call, Case, Values, Work};

/// A call over scores of this spread.
#[derive(Clone, Copy, Debug)]
pub struct SpreadKv {
    /// The attention.
    pub spec: Attention,
    /// Standard deviation of the scores.
    pub spread: f32,
    /// Whether the facts are those of the attention. For benches, whose shapes take the oracle minutes, any will do.
    pub exact: bool,
}

impl Call for SpreadKv {
    fn kernel(&self) -> &'static str {
        "attention_grad_kv"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        AttentionGradKv { attention: self.spec }.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let spec = &self.spec;
        let made = GradInputs::new(spec, self.spread);
        let Inputs { q, k, v } = &made.inputs;
        let facts = if self.exact {
            cpu::attention_grad_q(spec, q, k, v, &made.g).1
        } else {
            vec![3.0; (2 * spec.groups * spec.heads * spec.nq) as usize]
        };
        let inputs = made.inputs.args(spec, caps).into_iter().take(3);
        let turned = AttentionGradKv { attention: *spec }.turned_words();
        let outputs = [spec.kv_words(), spec.kv_words(), turned].map(|n| Values::Out(n as usize));
        inputs.chain([made.g_rows(spec), Values::F32(pad_facts(spec, &facts))]).chain(outputs).collect()
    }

    fn oracle(&self, _: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let spec = &self.spec;
        let GradInputs { inputs: Inputs { q, k, v }, g } = GradInputs::new(spec, self.spread);
        let (dk, dv) = cpu::attention_grad_kv(spec, &q, &k, &v, &g);
        let heads = (spec.groups * spec.heads) as usize;
        let rows = |x: &[f32]| Values::F32(pad(x, heads, spec.nk as usize, spec.head_dim as usize, false));
        vec![(DK, rows(&dk)), (DV, rows(&dv))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        bound(self.spread)
    }

    fn work(&self) -> Work {
        Work::Flops(AttentionGradKv { attention: self.spec }.flops())
    }
}

/// What `attention_grad_q` has.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = specs().into_iter().map(|(spec, spread)| Case::test(SpreadKv { spec, spread, exact: true }));
    tests
        .chain(shapes().into_iter().map(|(name, spec)| Case::bench(name, SpreadKv { spec, spread: 1.0, exact: false })))
        .collect()
}
