//! Gradients of [`crate::attention`]'s keys and values: `dk[j] = Σ_i p[i, j] (g[i] · v[j] − g[i] · out[i]) q[i]` and
//! `dv[j] = Σ_i p[i, j] g[i]` a head and group at a time, with g the gradient of the output and p the softmax, recomputed from q, k and
//! the facts that `attention_grad_q` leaves: no score is stored.
//!
//! q, k and v are what attention had, g is laid out like q. dk and dv are in rows, dk too: `split_heads_grad` reads all gradients so.

use omnix_shaders::{Shader, attention_grad_kv as shaders};

use crate::attention::Attention;
use crate::attention_sweep::{Sweep, turn};
use crate::split_heads::padded;
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Queries `[groups][heads][nq_pad][Dp]`, already scaled.
pub const Q: Arg = Arg(0);
/// Keys `[groups][heads][nk_pad / 32][Dp][32]`.
pub const K: Arg = Arg(1);
/// Values `[groups][heads][nk_pad][Dp]`.
pub const V: Arg = Arg(2);
/// Gradient of the output as heads, `[groups][heads][nq_pad][Dp]`, padding zero.
pub const D_OUT: Arg = Arg(3);
/// What `attention_grad_q` knows of each query, `[groups][heads][2][nq_pad]`.
pub const FACTS: Arg = Arg(4);
/// Output `[groups][heads][nk_pad][Dp]`, padding zero.
pub const DK: Arg = Arg(5);
/// Output `[groups][heads][nk_pad][Dp]`, padding zero.
pub const DV: Arg = Arg(6);
/// Scratch of [`AttentionGradKv::turned_words`] numbers, bound on software devices alone.
pub const TURNED: Arg = Arg(7);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttentionGradKv {
    /// The attention whose gradients they are.
    pub attention: Attention,
}

const KERNEL: &str = "attention_grad_kv";

impl AttentionGradKv {
    /// Multiply-adds of the four products, each counted as two operations; padding and exponentials not counted.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        self.attention.flops() * 2
    }

    /// 32-bit words of [`TURNED`]: queries and gradients in blocks.
    #[must_use]
    pub const fn turned_words(&self) -> u64 {
        2 * self.attention.q_words()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, D is odd or too wide, or 32 rows of a tensor or the facts of a head are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let spec = &self.attention;
        spec.check(KERNEL)?;
        let sweep = Sweep { kernel: KERNEL, attention: *spec, keys: true, work: 8 };
        let steps = sweep.steps(caps)?;
        let mut out = Vec::new();
        let blocks = spec.q_words();
        if caps.tier == Tier::Software {
            turn(spec, spec.nq, (Q, false), (TURNED, 0), caps, &mut out)?;
            turn(spec, spec.nq, (D_OUT, false), (TURNED, blocks), caps, &mut out)?;
        }
        let shader = self.shader(caps);
        for step in &steps {
            let own = |arg: Arg| sweep.own(arg, step);
            let stream = |arg: Arg, skip: u64| sweep.stream(arg, skip, step);
            let facts = sweep.facts(FACTS, step);
            let params = sweep.params(step);
            let (groups, operations) = sweep.groups(step, caps);
            let dispatch = if caps.tier == Tier::Software {
                let [q_blocks, g_blocks] = [0, blocks].map(|skip| stream(TURNED, skip));
                let streams = [q_blocks, g_blocks, stream(Q, 0), stream(D_OUT, 0)];
                let owned = [own(K), own(V), facts, own(DK), own(DV)];
                Dispatch::new(shader, &params, &[&streams[..], &owned[..]].concat(), groups)
            } else {
                let windows = [stream(Q, 0), own(K), own(V), stream(D_OUT, 0), facts, own(DK), own(DV)];
                Dispatch::new(shader, &params, &windows, groups)
            };
            out.push(dispatch.of_operations(operations));
        }
        Ok(out)
    }

    fn shader(&self, caps: &Caps) -> &'static Shader {
        use shaders as s;
        let of = |variants: [&'static Shader; 4]| variants[padded(self.attention.head_dim) as usize / 32 - 1];
        match caps.tier {
            Tier::Software => of([&s::SOFTWARE_32, &s::SOFTWARE_64, &s::SOFTWARE_96, &s::SOFTWARE_128]),
            Tier::Baseline => &s::BASELINE,
            Tier::Gpu => of([&s::GPU_32, &s::GPU_64, &s::GPU_96, &s::GPU_128]),
        }
    }
}
