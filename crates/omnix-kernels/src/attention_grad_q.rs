//! Gradient of [`crate::attention`]'s queries: `dq[i] = Σ_j p[i, j] (g[i] · v[j] − g[i] · out[i]) k[j]` a head and group at a time, with
//! g the gradient of the output and p the softmax, recomputed from q, k and the state that attention keeps
//! ([`Attention::keep_state`]): no score is stored.
//!
//! q, k and v are what attention had, g is laid out like q (`split_heads` does so), and so is dq. On the way the kernel writes what
//! `attention_grad_kv` needs too, [`FACTS`]: of each query the logarithm of its sum of exponentials, and g · out.

use omnix_shaders::{Shader, attention_grad_q as shaders};

use crate::attention::{Attention, Piece};
pub use crate::attention_sweep::AttentionGradParams;
use crate::attention_sweep::{self, Sweep, turn};
use crate::split_heads::padded;
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Queries `[groups][heads][nq_pad][Dp]`, already scaled.
pub const Q: Arg = Arg(0);
/// Keys `[groups][heads][nk_pad / 32][Dp][32]`.
pub const K: Arg = Arg(1);
/// Values `[groups][heads][nk_pad][Dp]`.
pub const V: Arg = Arg(2);
/// What attention computed, `[groups · nq, heads · head_dim]`.
pub const OUT: Arg = Arg(3);
/// Its gradient as heads, `[groups][heads][nq_pad][Dp]`, padding zero.
pub const D_OUT: Arg = Arg(4);
/// The state that attention kept, `[groups][heads][nq_pad][2]`.
pub const STATE: Arg = Arg(5);
/// Output `[groups][heads][nq_pad][Dp]`, padding zero.
pub const DQ: Arg = Arg(6);
/// Output `[groups][heads][2][nq_pad]`.
pub const FACTS: Arg = Arg(7);
/// Scratch of [`AttentionGradQ::turned_words`] numbers, bound on software devices alone.
pub const TURNED: Arg = Arg(8);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttentionGradQ {
    /// The attention whose gradient it is.
    pub attention: Attention,
}

const KERNEL: &str = "attention_grad_q";

impl AttentionGradQ {
    /// Multiply-adds of the three products, each counted as two operations; padding and exponentials not counted.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        self.attention.flops() / 2 * 3
    }

    /// 32-bit words of [`FACTS`].
    #[must_use]
    pub const fn facts_words(&self) -> u64 {
        self.attention.all_heads() * 2 * padded(self.attention.nq) as u64
    }

    /// 32-bit words of [`TURNED`]: keys in rows, values in blocks.
    #[must_use]
    pub const fn turned_words(&self) -> u64 {
        2 * self.attention.kv_words()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, D is odd or too wide, or 32 rows of a tensor or the facts of a head are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let spec = &self.attention;
        spec.check(KERNEL)?;
        let sweep = Sweep { kernel: KERNEL, attention: *spec, keys: false, work: 6 };
        let steps = sweep.steps(caps)?;
        let mut out = Vec::new();
        let queries = u64::from(padded(spec.nq));
        self.facts(&sweep, Piece { head0: 0, heads: spec.all_heads(), q0: 0, queries }, caps, &mut out)?;
        let blocks = spec.kv_words();
        if caps.tier == Tier::Software {
            turn(spec, spec.nk, (K, true), (TURNED, 0), caps, &mut out)?;
            turn(spec, spec.nk, (V, false), (TURNED, blocks), caps, &mut out)?;
        }
        let shader = self.shader(caps);
        for step in &steps {
            let own = |arg: Arg| sweep.own(arg, step);
            let stream = |arg: Arg, skip: u64| sweep.stream(arg, skip, step);
            let facts = sweep.facts(FACTS, step);
            let params = sweep.params(step);
            let (groups, operations) = sweep.groups(step, caps);
            let dispatch = if caps.tier == Tier::Software {
                let streams = [stream(K, 0), stream(TURNED, blocks), stream(TURNED, 0)];
                let windows = [own(Q), streams[0], streams[1], streams[2], own(D_OUT), facts, own(DQ)];
                Dispatch::new(shader, &params, &windows, groups)
            } else {
                let windows = [own(Q), stream(K, 0), stream(V, 0), own(D_OUT), facts, own(DQ)];
                Dispatch::new(shader, &params, &windows, groups)
            };
            out.push(dispatch.of_operations(operations));
        }
        Ok(out)
    }

    /// The facts of a piece of the queries, in halves until all windows fit.
    fn facts(&self, sweep: &Sweep, piece: Piece, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let spec = &self.attention;
        let (start, end) = spec.q_rows(&piece);
        let (out_start, out_end) = spec.out_window(&piece, caps);
        let facts = attention_sweep::facts(spec, FACTS, piece.head0, piece.heads);
        let heads_bytes = ((end - start) * spec.row_bytes()).max(facts.size.unwrap_or(0));
        let bytes = heads_bytes.max(out_end - out_start);
        if bytes <= caps.max_binding {
            let row0 = spec.out_row0(&piece);
            let row = u64::from(spec.heads) * u64::from(spec.head_dim);
            let params = AttentionGradParams {
                head_count: piece.heads as u32,
                own0: piece.q0 as u32,
                own_count: piece.queries as u32,
                own_base: if piece.heads == 1 { piece.q0 as u32 } else { 0 },
                head0: piece.head0 as u32,
                out_row0: row0 as u32,
                out_skip: (row0 * row - out_start / 4) as u32,
                ..sweep.sizes()
            };
            let windows = [
                OUT.window(out_start, out_end - out_start),
                D_OUT.window(start * spec.row_bytes(), (end - start) * spec.row_bytes()),
                STATE.window(start * 8, (end - start) * 8),
                facts,
            ];
            out.push(Dispatch::new(&shaders::FACTS, &params, &windows, (piece.heads * piece.queries).div_ceil(64)));
            return Ok(());
        }
        let Some((low, high)) = spec.halve(piece, heads_bytes > caps.max_binding) else {
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes, limit: caps.max_binding });
        };
        self.facts(sweep, low, caps, out)?;
        self.facts(sweep, high, caps, out)
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
