//! `out[g·nq + i, h·D + d] = Σ_j softmax_j(q[g, h, i] · k[g, h, j]) v[g, h, j, d]`: attention within groups (images, or
//! one group for all images), by the online softmax: the score matrix is never stored.
//!
//! q, k and v come from [`crate::split_heads`], which applies 1/√D to q: q and v in rows, k in key blocks, padded with
//! zeros. The output is unpadded, heads side by side. Queries do not see each other, and keys are summed in the same
//! steps whatever the windows, so splitting changes no bit. Where k and v need several windows, the unnormalised
//! sums wait in [`OUT`] and the running maximum and sum of a row in [`STATE`].

use omnix_shaders::{Shader, attention as shaders};

use crate::caps::UNIFORM_WINDOW;
use crate::dispatch::{MAX_OPERATIONS, round_up};
use crate::split_heads::{check_head, padded};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Queries `[groups][heads][nq_pad][Dp]`, already scaled.
pub const Q: Arg = Arg(0);
/// Keys `[groups][heads][nk_pad / 32][Dp][32]`.
pub const K: Arg = Arg(1);
/// Values `[groups][heads][nk_pad][Dp]`.
pub const V: Arg = Arg(2);
/// Output `[groups · nq, heads · head_dim]`.
pub const OUT: Arg = Arg(3);
/// The largest score and the sum of exponentials relative to it, `[groups][heads][nq_pad][2]`: an output where
/// [`Attention::keep_state`] asks for it (rows of padding are left as they are), else scratch, needed where
/// [`Attention::state_bytes`] is not 0.
pub const STATE: Arg = Arg(4);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attention {
    /// Independent sequences.
    pub groups: u32,
    /// Heads.
    pub heads: u32,
    /// Channels of a head, D: even, at most [`crate::split_heads::WIDEST_HEAD`].
    pub head_dim: u32,
    /// Queries of a group.
    pub nq: u32,
    /// Keys of a group.
    pub nk: u32,
    /// Whether [`STATE`] is written for all rows, as the gradients need it.
    pub keep_state: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/attention`.
    pub struct AttentionParams {
        heads: u32,
        head_dim: u32,
        nq: u32,
        nq_pad: u32,
        nk: u32,
        kv_pad: u32,
        head0: u32,
        head_count: u32,
        q0: u32,
        q_count: u32,
        q_base: u32,
        key0: u32,
        keys: u32,
        out_row0: u32,
        out_skip: u32,
        flags: u32,
    }
}

const FIRST: u32 = 1;
const LAST: u32 = 2;
const KEEP: u32 = 4;
/// Queries and keys are padded to a multiple of this.
const BLOCK: u64 = 32;
/// Queries a workgroup of the other variants owns.
const GROUP_QUERIES: u64 = 64;

/// Heads `head0 .. head0 + heads` (counted over the groups) and queries `q0 .. q0 + queries` of one dispatch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub(crate) head0: u64,
    pub(crate) heads: u64,
    pub(crate) q0: u64,
    pub(crate) queries: u64,
}

/// How keys and values are cut for a device.
#[derive(Clone, Copy, Debug)]
struct KeyWindows {
    /// Heads whose keys fit in one binding together; 1 when a head needs several windows.
    heads: u64,
    /// Keys of a window, a multiple of 32.
    keys: u64,
}

impl Attention {
    /// Multiply-adds of the two products, each counted as two operations; padding and exponentials not counted.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        4 * self.groups as u64 * self.heads as u64 * self.head_dim as u64 * self.nq as u64 * self.nk as u64
    }

    /// 32-bit words of [`Q`], padding included.
    #[must_use]
    pub const fn q_words(&self) -> u64 {
        self.all_heads() * padded(self.nq) as u64 * padded(self.head_dim) as u64
    }

    /// 32-bit words of [`K`], and of [`V`], padding included.
    #[must_use]
    pub const fn kv_words(&self) -> u64 {
        self.all_heads() * padded(self.nk) as u64 * padded(self.head_dim) as u64
    }

    /// 32-bit words of [`OUT`].
    #[must_use]
    pub const fn out_words(&self) -> u64 {
        self.all_heads() * self.nq as u64 * self.head_dim as u64
    }

    /// Bytes of [`STATE`]: 0 where one window holds all keys of a head and nobody asks for it; the argument is not bound then.
    #[must_use]
    pub fn state_bytes(&self, caps: &Caps) -> u64 {
        let one = self.key_windows(caps).keys >= u64::from(padded(self.nk));
        if one && !self.keep_state { 0 } else { self.all_heads() * u64::from(padded(self.nq)) * 8 }
    }

    pub(crate) const fn all_heads(&self) -> u64 {
        self.groups as u64 * self.heads as u64
    }

    /// Bytes of one padded row of q, k or v.
    pub(crate) const fn row_bytes(&self) -> u64 {
        padded(self.head_dim) as u64 * 4
    }

    fn key_windows(&self, caps: &Caps) -> KeyWindows {
        let limit = if caps.tier == Tier::Software { UNIFORM_WINDOW } else { caps.max_binding };
        // The fewest queries of a dispatch see all keys of its window.
        let limit = limit.min(MAX_OPERATIONS / GROUP_QUERIES);
        let keys = u64::from(padded(self.nk));
        let head_bytes = keys * self.row_bytes();
        if head_bytes <= limit {
            KeyWindows { heads: limit / head_bytes, keys }
        } else {
            KeyWindows { heads: 1, keys: limit / self.row_bytes() / BLOCK * BLOCK }
        }
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, D is odd or too wide, or 32 rows of the output are larger than the device's
    /// binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.check("attention")?;
        let windows = self.key_windows(caps);
        if windows.keys == 0 {
            let bytes = BLOCK * self.row_bytes();
            return Err(KernelError::RowTooLarge { kernel: "attention", bytes, limit: caps.max_binding });
        }
        let mut out = Vec::new();
        for head0 in (0..self.all_heads()).step_by(windows.heads as usize) {
            let heads = windows.heads.min(self.all_heads() - head0);
            let piece = Piece { head0, heads, q0: 0, queries: u64::from(padded(self.nq)) };
            self.split(piece, windows, caps, &mut out)?;
        }
        Ok(out)
    }

    /// Whether `kernel` can take the sizes.
    pub(crate) fn check(&self, kernel: &'static str) -> Result<(), KernelError> {
        let unsupported = |reason: String| KernelError::Unsupported { kernel, reason };
        if self.groups == 0 || self.heads == 0 || self.nq == 0 || self.nk == 0 {
            return Err(unsupported(format!(
                "{} groups of {} heads, {} queries and {} keys: none may be 0",
                self.groups, self.heads, self.nq, self.nk
            )));
        }
        check_head(self.head_dim).map_err(unsupported)
    }

    /// Halves a piece until its windows of q and out fit and it is short enough: groups first, then heads (when q is
    /// too large), then queries.
    fn split(&self, piece: Piece, keys: KeyWindows, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let (q_start, q_end) = self.q_rows(&piece);
        let q_bytes = (q_end - q_start) * self.row_bytes();
        let (out_start, out_end) = self.out_window(&piece, caps);
        let bytes = q_bytes.max(out_end - out_start);
        let flops = self.operations(&piece, keys.keys);
        if bytes <= caps.max_binding && (flops <= MAX_OPERATIONS || piece.heads == 1 && piece.queries <= GROUP_QUERIES)
        {
            let all = u64::from(padded(self.nk));
            for key0 in (0..all).step_by(keys.keys as usize) {
                out.push(self.dispatch(&piece, (key0, keys.keys.min(all - key0)), caps));
            }
            return Ok(());
        }
        let heads_apart = q_bytes > caps.max_binding || flops > MAX_OPERATIONS;
        let Some((low, high)) = self.halve(piece, heads_apart) else {
            return Err(KernelError::RowTooLarge { kernel: "attention", bytes, limit: caps.max_binding });
        };
        self.split(low, keys, caps, out)?;
        self.split(high, keys, caps, out)
    }

    /// Two halves of a piece: groups apart, then heads where `heads_apart` asks for it, then queries, down to a block of them.
    pub(crate) fn halve(&self, piece: Piece, heads_apart: bool) -> Option<(Piece, Piece)> {
        let heads = u64::from(self.heads);
        let (first, last) = (piece.head0 / heads, (piece.head0 + piece.heads - 1) / heads);
        let at_head = if last > first {
            Some((first + (last - first).div_ceil(2)) * heads - piece.head0)
        } else if piece.heads > 1 && heads_apart {
            Some(piece.heads / 2)
        } else {
            None
        };
        if let Some(at) = at_head {
            Some((Piece { heads: at, ..piece }, Piece { head0: piece.head0 + at, heads: piece.heads - at, ..piece }))
        } else if piece.queries > BLOCK {
            // Whole workgroups where there is a choice.
            let unit = if piece.queries > GROUP_QUERIES { GROUP_QUERIES } else { BLOCK };
            let at = round_up(piece.queries / 2, unit);
            Some((Piece { queries: at, ..piece }, Piece { q0: piece.q0 + at, queries: piece.queries - at, ..piece }))
        } else {
            None
        }
    }

    /// Rows of q and state around those of a piece: some of one head, or whole heads.
    pub(crate) fn q_rows(&self, piece: &Piece) -> (u64, u64) {
        let nq = u64::from(padded(self.nq));
        let start = piece.head0 * nq;
        if piece.heads == 1 {
            (start + piece.q0, start + piece.q0 + piece.queries)
        } else {
            (start, start + piece.heads * nq)
        }
    }

    /// The first row of out that a piece writes.
    pub(crate) fn out_row0(&self, piece: &Piece) -> u64 {
        piece.head0 / u64::from(self.heads) * u64::from(self.nq) + piece.q0
    }

    /// Bytes of out around what a piece writes, from an aligned start.
    pub(crate) fn out_window(&self, piece: &Piece, caps: &Caps) -> (u64, u64) {
        let (heads, nq) = (u64::from(self.heads), u64::from(self.nq));
        let bytes = heads * u64::from(self.head_dim) * 4;
        let end = (piece.head0 + piece.heads - 1) / heads * nq + (piece.q0 + piece.queries).min(nq);
        (self.out_row0(piece) * bytes / caps.align * caps.align, end * bytes)
    }

    fn dispatch(&self, piece: &Piece, (key0, keys): (u64, u64), caps: &Caps) -> Dispatch {
        let (nk_pad, row_bytes) = (u64::from(padded(self.nk)), self.row_bytes());
        let windowed = keys < nk_pad;
        let (out_start, out_end) = self.out_window(piece, caps);
        let out_row0 = self.out_row0(piece);
        let out_row = u64::from(self.heads) * u64::from(self.head_dim);
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let last = key0 + keys == nk_pad;
        let params = AttentionParams {
            heads: self.heads,
            head_dim: self.head_dim,
            nq: self.nq,
            nq_pad: padded(self.nq),
            nk: self.nk,
            kv_pad: nk_pad as u32,
            head0: piece.head0 as u32,
            head_count: piece.heads as u32,
            q0: piece.q0 as u32,
            q_count: piece.queries as u32,
            q_base: if piece.heads == 1 { piece.q0 as u32 } else { 0 },
            key0: key0 as u32,
            keys: keys as u32,
            out_row0: out_row0 as u32,
            out_skip: (out_row0 * out_row - out_start / 4) as u32,
            flags: set(key0 == 0, FIRST) | set(last, LAST) | set(!last || self.keep_state, KEEP),
        };
        let (q_start, q_end) = self.q_rows(piece);
        let kv_start = (piece.head0 * nk_pad + key0) * row_bytes;
        // One head's keys of this window, or those of all heads of the piece.
        let kv = if windowed { keys * row_bytes } else { piece.heads * nk_pad * row_bytes };
        let state = if windowed || self.keep_state {
            STATE.window(q_start * 8, (q_end - q_start) * 8)
        } else {
            Arg::ABSENT.into()
        };
        let windows = [
            Q.window(q_start * row_bytes, (q_end - q_start) * row_bytes),
            K.window(kv_start, kv),
            V.window(kv_start, kv),
            OUT.window(out_start, out_end - out_start),
            state,
        ];
        let groups = match caps.tier {
            _ if self.twos() => (piece.heads * piece.queries).div_ceil(GROUP_QUERIES),
            Tier::Software => piece.heads * piece.queries.div_ceil(self.software_queries()),
            Tier::Gpu => piece.heads * piece.queries.div_ceil(GROUP_QUERIES),
            Tier::Baseline => (piece.heads * piece.queries).div_ceil(GROUP_QUERIES),
        };
        Dispatch::new(self.shader(caps), &params, &windows, groups).of_operations(self.operations(piece, keys))
    }

    /// Operations of a piece with some keys, padding included; 4 per query, key and channel.
    const fn operations(&self, piece: &Piece, keys: u64) -> u64 {
        piece.heads * piece.queries * keys * self.row_bytes()
    }

    /// Queries a subgroup of the software variants owns (`TM` in the sidecar file).
    const fn software_queries(&self) -> u64 {
        if padded(self.head_dim) == 128 { 16 } else { 24 }
    }

    /// Whether heads of the output start at multiples of two channels only, which one text for all devices serves.
    const fn twos(&self) -> bool {
        !self.head_dim.is_multiple_of(4)
    }

    fn shader(&self, caps: &Caps) -> &'static Shader {
        use shaders as s;
        if self.twos() {
            return &s::BASELINE_TWOS;
        }
        let products = caps.products();
        let of = |variants: [&'static Shader; 4]| variants[padded(self.head_dim) as usize / 32 - 1];
        match caps.tier {
            Tier::Software if self.head_dim.is_multiple_of(8) => {
                of([&s::SOFTWARE_32, &s::SOFTWARE_64, &s::SOFTWARE_96, &s::SOFTWARE_128])
            }
            Tier::Software => of([&s::SOFTWARE_32, &s::SOFTWARE_64_FOURS, &s::SOFTWARE_96, &s::SOFTWARE_128_FOURS]),
            Tier::Baseline => &s::BASELINE,
            Tier::Gpu if caps.has_quads() && products.f16_16 && caps.f16 => {
                of([&s::COOPERATIVE_16_32, &s::COOPERATIVE_16_64, &s::COOPERATIVE_16_96, &s::COOPERATIVE_16_128])
            }
            Tier::Gpu if caps.has_quads() && products.f32_8 => {
                of([&s::COOPERATIVE_8_32, &s::COOPERATIVE_8_64, &s::COOPERATIVE_8_96, &s::COOPERATIVE_8_128])
            }
            Tier::Gpu if caps.has_quads() && caps.f16 => of([&s::F16_32, &s::F16_64, &s::F16_96, &s::F16_128]),
            Tier::Gpu if caps.has_quads() => of([&s::SUBGROUP_32, &s::SUBGROUP_64, &s::SUBGROUP_96, &s::SUBGROUP_128]),
            Tier::Gpu => of([&s::GPU_32, &s::GPU_64, &s::GPU_96, &s::GPU_128]),
        }
    }
}
