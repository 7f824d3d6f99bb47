//! Columns of a token tensor → one head-major tensor for `attention`, with the optional layer norm of q and k
//! and **RoPE** (the rotary position code; `shaders/lib/rope.wgsl`) on the way:
//!
//! `y[g, h, t, ·] = scale · rope_t(norm(x[g · tokens + t, x_offset + h · D .. + D]))`
//!
//! `x` is `[groups · tokens, x_stride]`, so q, k and v come out of one product `[.., 3C]` by three calls. The output is
//! padded with zeros: tokens to a multiple of 32, D to `Dp`, a multiple of 32 ([`HeadLayout`]).
//!
//! RoPE: the first half of D turns with the row of a token, the second with its column; within a half, channel
//! j < D/4 pairs with j + D/4. A row of [`TABLE`] has D/2 cosines (row half first), then D/2 sines; token t
//! takes row t mod `rope_rows`. Every output depends on one row of x alone: splitting changes no bit.

use omnix_shaders::split_heads as shaders;

use crate::dispatch::round_up;
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[groups · tokens, x_stride]`.
pub const X: Arg = Arg(0);
/// `[head_dim]`, of the norm.
pub const WEIGHT: Arg = Arg(1);
/// `[head_dim]`, of the norm.
pub const BIAS: Arg = Arg(2);
/// RoPE: `[rope_rows][head_dim]`, cosines then sines.
pub const TABLE: Arg = Arg(3);
/// Output, [`SplitHeads::words`] numbers.
pub const Y: Arg = Arg(4);

/// How the output lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HeadLayout {
    /// `[groups][heads][tokens_pad][Dp]`: queries and values.
    Rows,
    /// `[groups][heads][tokens_pad / 32][Dp][32]`, transposed blocks of 32 tokens: keys.
    KeyBlocks,
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitHeads {
    /// Independent sequences.
    pub groups: u32,
    /// Tokens of a group.
    pub tokens: u32,
    /// Heads.
    pub heads: u32,
    /// Channels of a head, D: even, at most [`WIDEST_HEAD`]; with RoPE a multiple of 4.
    pub head_dim: u32,
    /// Numbers from one row of x to the next.
    pub x_stride: u32,
    /// Column of x where head 0 starts.
    pub x_offset: u32,
    /// The eps of a layer norm over the D channels, with [`WEIGHT`] and [`BIAS`].
    pub norm: Option<f32>,
    /// Rows of the RoPE [`TABLE`].
    pub rope_rows: Option<u32>,
    /// Multiplies the result; 1/√D for queries.
    pub scale: f32,
    /// Layout of the output.
    pub layout: HeadLayout,
}

crate::layout::params! {
    /// `Params` of `shaders/split_heads`.
    pub struct SplitHeadsParams {
        tokens: u32,
        tokens_pad: u32,
        heads: u32,
        head_dim: u32,
        dp: u32,
        x_stride: u32,
        x_offset: u32,
        x_row0: u32,
        head0: u32,
        head_count: u32,
        t0: u32,
        t_count: u32,
        y_t0: u32,
        rope_rows: u32,
        flags: u32,
        eps: f32,
        scale: f32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

const NORM: u32 = 1;
const ROPE: u32 = 2;
const KEY_BLOCKS: u32 = 4;
/// Tokens and channels are padded to a multiple of this.
const BLOCK: u64 = 32;

/// The widest head that the kernels take: a row of it stays in registers.
pub const WIDEST_HEAD: u32 = 128;

/// Whether heads of `head_dim` channels can be computed: any even number up to [`WIDEST_HEAD`], padded to a multiple of 32.
pub(crate) fn check_head(head_dim: u32) -> Result<(), String> {
    if head_dim.is_multiple_of(2) && (2..=WIDEST_HEAD).contains(&head_dim) {
        return Ok(());
    }
    Err(format!("heads of {head_dim} channels; an even number from 2 to {WIDEST_HEAD} is possible"))
}

/// Tokens rounded up as [`Y`] has them.
#[must_use]
pub const fn padded(n: u32) -> u32 {
    n.div_ceil(BLOCK as u32) * BLOCK as u32
}

/// Heads `head0 .. head0 + heads` (counted over the groups) and tokens `t0 .. t0 + tokens` of one dispatch.
#[derive(Clone, Copy, Debug)]
struct Piece {
    head0: u64,
    heads: u64,
    t0: u64,
    tokens: u64,
}

impl SplitHeads {
    /// Tokens and channels of a head with their padding.
    #[must_use]
    pub const fn padded(&self) -> (u32, u32) {
        (padded(self.tokens), padded(self.head_dim))
    }

    /// 32-bit words of [`Y`], padding included.
    #[must_use]
    pub const fn words(&self) -> u64 {
        let (tokens, channels) = self.padded();
        self.groups as u64 * self.heads as u64 * tokens as u64 * channels as u64
    }

    /// Bytes read from x and written to y once each.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * (self.groups as u64 * self.tokens as u64 * self.heads as u64 * self.head_dim as u64 + self.words())
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, D is odd, too wide or not a multiple of 4 beside RoPE, the heads do not fit in a row of x, or 32 rows
    /// of x are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.check("split_heads", caps)?;
        let (tokens, _) = self.padded();
        let whole =
            Piece { head0: 0, heads: u64::from(self.groups) * u64::from(self.heads), t0: 0, tokens: u64::from(tokens) };
        let mut out = Vec::new();
        self.split(whole, caps, &mut out)?;
        Ok(out)
    }

    /// Whether `kernel` can take the sizes.
    pub(crate) fn check(&self, kernel: &'static str, caps: &Caps) -> Result<(), KernelError> {
        let fail = |reason: String| Err(KernelError::Unsupported { kernel, reason });
        if self.groups == 0 || self.tokens == 0 || self.heads == 0 {
            return fail(format!(
                "{} groups of {} tokens and {} heads: none may be 0",
                self.groups, self.tokens, self.heads
            ));
        }
        check_head(self.head_dim).or_else(fail)?;
        if self.rope_rows.is_some() && !self.head_dim.is_multiple_of(4) {
            return fail(format!(
                "RoPE turns pairs in both halves of a head: {} channels are no multiple of 4",
                self.head_dim
            ));
        }
        let end = u64::from(self.x_offset) + u64::from(self.heads) * u64::from(self.head_dim);
        if end > u64::from(self.x_stride) {
            return fail(format!("the heads end at column {end}, but x has {} columns", self.x_stride));
        }
        match self.rope_rows {
            Some(0) => fail("a RoPE table without rows".to_owned()),
            Some(rows) if u64::from(rows) * u64::from(self.head_dim) * 4 > caps.max_binding => {
                fail(format!("a RoPE table of {rows} rows exceeds the device's {} bytes a binding", caps.max_binding))
            }
            _ => Ok(()),
        }
    }

    /// Halves a piece until its windows of x and y fit: groups first, then heads (when y is too large), then tokens.
    fn split(&self, piece: Piece, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let (x_start, x_end) = self.x_window(&piece, caps);
        let (y_start, y_end) = self.y_window(&piece);
        let bytes = (x_end - x_start).max(y_end - y_start);
        if bytes <= caps.max_binding {
            out.push(self.dispatch(&piece, caps));
            return Ok(());
        }
        let heads = u64::from(self.heads);
        let (first, last) = (piece.head0 / heads, (piece.head0 + piece.heads - 1) / heads);
        let at_head = if last > first {
            Some((first + (last - first).div_ceil(2)) * heads - piece.head0)
        } else if piece.heads > 1 && y_end - y_start > caps.max_binding {
            Some(piece.heads / 2)
        } else {
            None
        };
        let (low, high) = if let Some(at) = at_head {
            (Piece { heads: at, ..piece }, Piece { head0: piece.head0 + at, heads: piece.heads - at, ..piece })
        } else if piece.tokens > BLOCK {
            let at = round_up(piece.tokens / 2, BLOCK);
            (Piece { tokens: at, ..piece }, Piece { t0: piece.t0 + at, tokens: piece.tokens - at, ..piece })
        } else {
            return Err(KernelError::RowTooLarge { kernel: "split_heads", bytes, limit: caps.max_binding });
        };
        self.split(low, caps, out)?;
        self.split(high, caps, out)
    }

    /// Bytes of x that a piece reads, from an aligned start.
    fn x_window(&self, piece: &Piece, caps: &Caps) -> (u64, u64) {
        let (tokens, row_bytes) = (u64::from(self.tokens), u64::from(self.x_stride) * 4);
        let row0 = self.row0(piece);
        let last = (piece.head0 + piece.heads - 1) / u64::from(self.heads);
        let end = last * tokens + (piece.t0 + piece.tokens).min(tokens);
        (row0 * row_bytes / caps.align * caps.align, end * row_bytes)
    }

    /// The first row of x that a piece reads.
    fn row0(&self, piece: &Piece) -> u64 {
        piece.head0 / u64::from(self.heads) * u64::from(self.tokens) + piece.t0
    }

    /// Bytes of y around what a piece writes: tokens of one head, or whole heads.
    fn y_window(&self, piece: &Piece) -> (u64, u64) {
        let (tokens, channels) = self.padded();
        let token_bytes = u64::from(channels) * 4;
        let head_bytes = u64::from(tokens) * token_bytes;
        if piece.heads == 1 {
            let start = piece.head0 * head_bytes + piece.t0 * token_bytes;
            (start, start + piece.tokens * token_bytes)
        } else {
            (piece.head0 * head_bytes, (piece.head0 + piece.heads) * head_bytes)
        }
    }

    fn dispatch(&self, piece: &Piece, caps: &Caps) -> Dispatch {
        let (tokens_pad, dp) = self.padded();
        let (x_start, x_end) = self.x_window(piece, caps);
        let (y_start, y_end) = self.y_window(piece);
        let row0 = self.row0(piece);
        let skip = row0 * u64::from(self.x_stride) - x_start / 4;
        let rope = self.rope_rows.is_some();
        let fours = [self.x_stride, self.x_offset, self.head_dim].iter().all(|n| n.is_multiple_of(4));
        let shader = match caps.tier {
            _ if !fours || rope && !self.head_dim.is_multiple_of(16) => &shaders::BASELINE,
            Tier::Software if self.layout == HeadLayout::Rows => &shaders::SOFTWARE_ROWS,
            Tier::Software => &shaders::SOFTWARE_KEYS,
            _ => &shaders::VEC4,
        };
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let params = SplitHeadsParams {
            tokens: self.tokens,
            tokens_pad,
            heads: self.heads,
            head_dim: self.head_dim,
            dp,
            x_stride: self.x_stride,
            x_offset: self.x_offset + skip as u32,
            x_row0: row0 as u32,
            head0: piece.head0 as u32,
            head_count: piece.heads as u32,
            t0: piece.t0 as u32,
            t_count: piece.tokens as u32,
            y_t0: if piece.heads == 1 { piece.t0 as u32 } else { 0 },
            rope_rows: self.rope_rows.unwrap_or(1),
            flags: set(self.norm.is_some(), NORM)
                | set(rope, ROPE)
                | set(self.layout == HeadLayout::KeyBlocks, KEY_BLOCKS),
            eps: self.norm.unwrap_or(0.0),
            scale: self.scale,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        let norm = self.norm.is_some();
        let windows = [
            X.window(x_start, x_end - x_start),
            WEIGHT.when(norm).into(),
            BIAS.when(norm).into(),
            TABLE.when(rope).into(),
            Y.window(y_start, y_end - y_start),
        ];
        Dispatch::new(shader, &params, &windows, (piece.heads * piece.tokens).div_ceil(64))
    }
}
