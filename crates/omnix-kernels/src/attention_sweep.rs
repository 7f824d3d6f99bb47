//! What the two kernels of attention's gradients share on the host: how owned rows and streaming rows (queries and keys, or the other
//! way round) are cut for a device, their parameters, and the turning of padded heads between rows and transposed blocks.
//!
//! Owned rows do not see each other, and streaming rows are summed in the same steps whatever the windows, so cutting changes no bit.

use crate::attention::Attention;
use crate::caps::UNIFORM_WINDOW;
use crate::copy::{self, Copy, Strided};
use crate::split_heads::padded;
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

crate::layout::params! {
    /// `Params` of `shaders/attention_grad_q` and `shaders/attention_grad_kv`.
    #[derive(Default)]
    pub struct AttentionGradParams {
        pub(crate) nq: u32,
        pub(crate) nk: u32,
        pub(crate) nq_pad: u32,
        pub(crate) nk_pad: u32,
        pub(crate) head_dim: u32,
        pub(crate) dp4: u32,
        pub(crate) head_count: u32,
        pub(crate) own0: u32,
        pub(crate) own_count: u32,
        pub(crate) own_base: u32,
        pub(crate) stream0: u32,
        pub(crate) stream_count: u32,
        pub(crate) flags: u32,
        pub(crate) head0: u32,
        pub(crate) heads: u32,
        pub(crate) out_row0: u32,
        pub(crate) out_skip: u32,
        pub(crate) pad0: u32,
        pub(crate) pad1: u32,
        pub(crate) pad2: u32,
    }
}

const FIRST: u32 = 1;
/// Rows are padded to a multiple of this.
const BLOCK: u64 = 32;

/// A gradient summed in owned rows while others stream by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep {
    pub kernel: &'static str,
    pub attention: Attention,
    /// Whether keys are owned and queries stream.
    pub keys: bool,
    /// Operations per pair of rows and channel.
    pub work: u64,
}

/// What one dispatch sums: heads (counted over the groups), owned and streaming rows; some rows of one head or all of several.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub head0: u64,
    pub heads: u64,
    pub own0: u64,
    pub own: u64,
    pub stream0: u64,
    pub stream: u64,
}

impl Sweep {
    /// Padded owned rows and streaming rows of a head.
    fn rows(&self) -> [u64; 2] {
        let [queries, keys] = [self.attention.nq, self.attention.nk].map(|n| u64::from(padded(n)));
        if self.keys { [keys, queries] } else { [queries, keys] }
    }

    /// Operations of some rows of some heads, padding included.
    fn operations(&self, heads: u64, own: u64, stream: u64) -> u64 {
        self.work * heads * own * stream * u64::from(padded(self.attention.head_dim))
    }

    /// The steps in order: all streaming rows of an owned piece follow one another.
    ///
    /// # Errors
    /// When 32 padded rows of a head, or its facts, are larger than the device's binding limit.
    pub(crate) fn steps(&self, caps: &Caps) -> Result<Vec<Step>, KernelError> {
        let (kernel, limit, row) = (self.kernel, caps.max_binding, self.attention.row_bytes());
        let window = if caps.tier == Tier::Software { UNIFORM_WINDOW.min(limit) } else { limit };
        let [own_all, stream_all] = self.rows();
        let facts = u64::from(padded(self.attention.nq)) * 8;
        if facts.max(BLOCK * row) > limit.min(window) && facts.max(BLOCK * row) > limit {
            return Err(KernelError::RowTooLarge { kernel, bytes: facts.max(BLOCK * row), limit });
        }
        let most = caps.max_operations();
        let together = (window / (stream_all * row))
            .min(limit / (own_all * row))
            .min(limit / facts)
            .min(most / self.operations(1, own_all, stream_all));
        let heads = self.attention.all_heads();
        let mut steps = Vec::new();
        if together > 0 {
            for head0 in (0..heads).step_by(together as usize) {
                let heads = together.min(heads - head0);
                steps.push(Step { head0, heads, own0: 0, own: own_all, stream0: 0, stream: stream_all });
            }
            return Ok(steps);
        }
        let blocks = |rows: u64| rows / BLOCK * BLOCK;
        let stream_fit = blocks(window / row).min(blocks(most / self.operations(1, BLOCK, 1))).min(stream_all);
        let own_fit = blocks(limit / row).min(blocks(most / self.operations(1, 1, stream_fit.max(1)))).min(own_all);
        if stream_fit == 0 || own_fit == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: BLOCK * row, limit });
        }
        for head0 in 0..heads {
            for own0 in (0..own_all).step_by(own_fit as usize) {
                for stream0 in (0..stream_all).step_by(stream_fit as usize) {
                    let (own, stream) = (own_fit.min(own_all - own0), stream_fit.min(stream_all - stream0));
                    steps.push(Step { head0, heads: 1, own0, own, stream0, stream });
                }
            }
        }
        Ok(steps)
    }

    /// Parameters with the sizes, and nothing of a step.
    pub(crate) fn sizes(&self) -> AttentionGradParams {
        let spec = &self.attention;
        AttentionGradParams {
            nq: spec.nq,
            nk: spec.nk,
            nq_pad: padded(spec.nq),
            nk_pad: padded(spec.nk),
            head_dim: spec.head_dim,
            dp4: padded(spec.head_dim) / 4,
            heads: spec.heads,
            ..AttentionGradParams::default()
        }
    }

    /// Parameters of a step.
    pub(crate) fn params(&self, step: &Step) -> AttentionGradParams {
        AttentionGradParams {
            head_count: step.heads as u32,
            own0: step.own0 as u32,
            own_count: step.own as u32,
            own_base: step.own0 as u32,
            stream0: step.stream0 as u32,
            stream_count: step.stream as u32,
            flags: if step.stream0 == 0 { FIRST } else { 0 },
            head0: step.head0 as u32,
            ..self.sizes()
        }
    }

    /// The window over the owned rows of a step.
    pub(crate) fn own(&self, arg: Arg, step: &Step) -> crate::dispatch::Window {
        let (row, [all, _]) = (self.attention.row_bytes(), self.rows());
        let rows = if step.own == all { step.heads * all } else { step.own };
        arg.window((step.head0 * all + step.own0) * row, rows * row)
    }

    /// The window over the streaming rows of a step, `skip` words into the argument.
    pub(crate) fn stream(&self, arg: Arg, skip: u64, step: &Step) -> crate::dispatch::Window {
        let (row, [_, all]) = (self.attention.row_bytes(), self.rows());
        let rows = if step.stream == all { step.heads * all } else { step.stream };
        arg.window(skip * 4 + (step.head0 * all + step.stream0) * row, rows * row)
    }

    /// The window over the facts of a step's heads.
    pub(crate) fn facts(&self, arg: Arg, step: &Step) -> crate::dispatch::Window {
        facts(&self.attention, arg, step.head0, step.heads)
    }

    /// Workgroups of a step, and its operations.
    pub(crate) fn groups(&self, step: &Step, caps: &Caps) -> (u64, u64) {
        let rows = step.heads * step.own;
        let groups = match caps.tier {
            // `TM` in the sidecar files.
            Tier::Software => rows / if padded(self.attention.head_dim) == 32 { 32 } else { 16 },
            Tier::Baseline => rows.div_ceil(64),
            Tier::Gpu => rows / BLOCK,
        };
        (groups, self.operations(step.heads, step.own, step.stream))
    }
}

/// The window over the facts of some heads.
pub(crate) fn facts(attention: &Attention, arg: Arg, head0: u64, heads: u64) -> crate::dispatch::Window {
    let head = u64::from(padded(attention.nq)) * 8;
    arg.window(head0 * head, heads * head)
}

/// Padded heads of `n` rows in `from`, in transposed blocks or in rows, the other way round in `to` from a word on.
pub(crate) fn turn(
    attention: &Attention,
    n: u32,
    (from, blocks): (Arg, bool),
    (to, skip): (Arg, u64),
    caps: &Caps,
    out: &mut Vec<Dispatch>,
) -> Result<(), KernelError> {
    let (channels, rows) = (padded(attention.head_dim), padded(n));
    let heads = attention.all_heads() * u64::from(rows / 32);
    // A product that is too large for 32 bits has failed before: it is the number of rows over 32.
    let shape = [heads as u32, 32, channels, 1, 1, 1];
    let in_rows = |offset| Strided { offset, strides: [32 * channels, channels, 1, 0, 0, 0] };
    let in_blocks = |offset| Strided { offset, strides: [32 * channels, 1, 32, 0, 0, 0] };
    let (src, dst) = if blocks { (in_blocks(0), in_rows(skip)) } else { (in_rows(0), in_blocks(skip)) };
    for mut dispatch in (Copy { shape, src, dst }).record(caps)? {
        for window in &mut dispatch.windows {
            window.arg = if window.arg == copy::X { from } else { to };
        }
        out.push(dispatch);
    }
    Ok(())
}
