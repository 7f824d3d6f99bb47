//! Gradients of [`crate::split_heads`]: from the gradient of its output, in rows whatever the layout of the output was, back to columns
//! of a token tensor. With n the normalised channels of a head:
//!
//! - `u = scale · rope⁻¹(dy)`, the rotation with the sines' sign changed;
//! - `dx = u`, or with a norm and `g = u · weight`: `(g − mean g − n · mean(g n)) / √(var + eps)`;
//! - `dweight[d] = Σ u n`, `dbias[d] = Σ u` over all tokens and heads.
//!
//! Only the heads' columns of [`DX`] are written: calls for q, k and v can fill one tensor. Sums over tokens are cut as those of
//! [`crate::linear_weights`], those of heads added last: splitting changes no bit.

use omnix_shaders::split_heads_grad as shaders;

use crate::cover::{cover, room, unit};
use crate::dispatch::{Window, round_up};
use crate::linear_weights::{PART, add, column_sections};
use crate::sections::{Run, Sections};
use crate::split_heads::{SplitHeads, padded};
use crate::{Arg, Caps, Dispatch, KernelError};

/// What `split_heads` had, `[groups · tokens, x_stride]`; read where there is a norm.
pub const X: Arg = Arg(0);
/// `[head_dim]`, of the norm.
pub const WEIGHT: Arg = Arg(1);
/// RoPE: `[rope_rows][head_dim]`, cosines then sines.
pub const TABLE: Arg = Arg(2);
/// Gradient of the output, `[groups][heads][tokens_pad][Dp]`; padding is not read.
pub const DY: Arg = Arg(3);
/// Output `[groups · tokens, dx_stride]`, the heads' columns of it.
pub const DX: Arg = Arg(4);
/// Output `[head_dim]`, where there is a norm.
pub const D_WEIGHT: Arg = Arg(5);
/// Output `[head_dim]`, where there is a norm.
pub const D_BIAS: Arg = Arg(6);
/// Scratch `[groups · tokens][heads][2]`; bound without a norm too, since what stands for absent arguments is read.
pub const STATS: Arg = Arg(7);
/// Scratch of [`SplitHeadsGrad::parts_words`] numbers.
pub const PARTS: Arg = Arg(8);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitHeadsGrad {
    /// The call whose gradients they are; its layout does not matter.
    pub heads: SplitHeads,
    /// Numbers from one row of dx to the next.
    pub dx_stride: u32,
    /// Column of dx where head 0 starts.
    pub dx_offset: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/split_heads_grad`.
    #[derive(Default)]
    pub struct SplitHeadsGradParams {
        tokens: u32,
        tokens_pad: u32,
        heads: u32,
        head_dim: u32,
        dp: u32,
        x_stride: u32,
        x_offset: u32,
        dx_stride: u32,
        dx_offset: u32,
        row0: u32,
        stats_rest: u32,
        dy_row0: u32,
        head0: u32,
        head_count: u32,
        t0: u32,
        t_count: u32,
        rope_rows: u32,
        flags: u32,
        eps: f32,
        scale: f32,
        first: u32,
        m: u32,
        section: u32,
        step: u32,
        weight_rest: u32,
        bias_rest: u32,
        pad0: u32,
        pad1: u32,
    }
}

const KERNEL: &str = "split_heads_grad";
const NORM: u32 = 1;
const ROPE: u32 = 2;
const GO_ON: u32 = 4;
/// Tokens are padded to a multiple of this, and cut at one.
const BLOCK: u64 = 32;

/// Heads (counted over the groups) and tokens of one dispatch.
#[derive(Clone, Copy, Debug)]
struct Piece {
    head0: u64,
    heads: u64,
    t0: u64,
    tokens: u64,
}

impl SplitHeadsGrad {
    /// Bytes of dy and dx, and of x with a norm, once each.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let numbers = self.rows() * self.columns();
        if self.heads.norm.is_some() { 12 * numbers } else { 8 * numbers }
    }

    /// 32-bit words of [`STATS`].
    #[must_use]
    pub const fn stats_words(&self) -> u64 {
        self.rows() * self.heads.heads as u64 * 2
    }

    /// 32-bit words of [`PARTS`]: 0 without a norm, and the argument is not bound.
    #[must_use]
    pub fn parts_words(&self) -> u64 {
        // Those of the weight, then those of the bias.
        if self.heads.norm.is_some() { 2 * self.region() } else { 0 }
    }

    /// Rows of x.
    const fn rows(&self) -> u64 {
        self.heads.groups as u64 * self.heads.tokens as u64
    }

    /// Columns of all heads.
    const fn columns(&self) -> u64 {
        self.heads.heads as u64 * self.heads.head_dim as u64
    }

    fn sections(&self) -> Sections {
        column_sections(self.rows(), self.columns())
    }

    /// Words of the sums of one output.
    fn region(&self) -> u64 {
        round_up(self.sections().count() * self.columns(), 64)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// As [`SplitHeads::record`]; when the heads do not fit in a row of dx, or 32 rows of it, or with a norm 64 rows of x or the tokens of
    /// one head, are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let spec = &self.heads;
        spec.check(KERNEL, caps)?;
        let end = u64::from(self.dx_offset) + self.columns();
        if end > u64::from(self.dx_stride) {
            let reason = format!("the heads end at column {end}, but dx has {} columns", self.dx_stride);
            return Err(KernelError::Unsupported { kernel: KERNEL, reason });
        }
        let mut out = Vec::new();
        let heads = u64::from(spec.groups) * u64::from(spec.heads);
        self.split(Piece { head0: 0, heads, t0: 0, tokens: padded(spec.tokens).into() }, caps, &mut out)?;
        if spec.norm.is_some() {
            let sums = self.sections();
            for (run, first, heads) in self.runs(caps)? {
                out.push(self.sum(&sums, run, (first, heads), caps));
            }
            let d = u64::from(spec.head_dim);
            for (arg, region) in [(D_WEIGHT, 0), (D_BIAS, self.region())] {
                let count = sums.count() * u64::from(spec.heads);
                add(KERNEL, (PARTS, region, d), count, (arg, 0, d), caps, &mut out)?;
            }
        }
        Ok(out)
    }

    /// Halves a piece until its windows fit: groups first, then heads where dy is too large, then tokens.
    fn split(&self, piece: Piece, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let (row0, row1) = self.token_rows(&piece);
        let width = u64::from(self.heads.x_stride.max(self.dx_stride).max(2 * self.heads.heads));
        let dy = self.dy_window(&piece).size.unwrap_or(0);
        let bytes = ((row1 - row0) * width * 4 + caps.align).max(dy);
        if bytes <= caps.max_binding {
            out.push(self.dispatch(&piece, caps));
            return Ok(());
        }
        let heads = u64::from(self.heads.heads);
        let (first, last) = (piece.head0 / heads, (piece.head0 + piece.heads - 1) / heads);
        let at_head = if last > first {
            Some((first + (last - first).div_ceil(2)) * heads - piece.head0)
        } else if piece.heads > 1 && dy > caps.max_binding {
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
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes, limit: caps.max_binding });
        };
        self.split(low, caps, out)?;
        self.split(high, caps, out)
    }

    /// Rows of x and dx of a piece: first, and one past the last.
    fn token_rows(&self, piece: &Piece) -> (u64, u64) {
        let (heads, tokens) = (u64::from(self.heads.heads), u64::from(self.heads.tokens));
        let last = (piece.head0 + piece.heads - 1) / heads;
        let first = (piece.head0 / heads * tokens + piece.t0).min(self.rows() - 1);
        (first, (last * tokens + (piece.t0 + piece.tokens).min(tokens)).max(first + 1))
    }

    /// The window over dy around a piece: tokens of one head, or whole heads.
    fn dy_window(&self, piece: &Piece) -> Window {
        let (tokens, channels) = self.heads.padded();
        let (tokens, row) = (u64::from(tokens), u64::from(channels) * 4);
        if piece.heads == 1 {
            DY.window((piece.head0 * tokens + piece.t0) * row, piece.tokens * row)
        } else {
            DY.window(piece.head0 * tokens * row, piece.heads * tokens * row)
        }
    }

    /// Parameters with the sizes, for windows that begin in or before row `row0`.
    fn sizes(&self) -> SplitHeadsGradParams {
        let spec = &self.heads;
        let (tokens_pad, dp) = spec.padded();
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        SplitHeadsGradParams {
            tokens: spec.tokens,
            tokens_pad,
            heads: spec.heads,
            head_dim: spec.head_dim,
            dp,
            x_stride: spec.x_stride,
            dx_stride: self.dx_stride,
            rope_rows: spec.rope_rows.unwrap_or(1),
            flags: set(spec.norm.is_some(), NORM) | set(spec.rope_rows.is_some(), ROPE),
            eps: spec.norm.unwrap_or(0.0),
            scale: spec.scale,
            ..SplitHeadsGradParams::default()
        }
    }

    /// Whether four channels can be taken at a time.
    fn fours(&self, with_dx: bool) -> bool {
        let spec = &self.heads;
        let plain = [spec.x_stride, spec.x_offset, spec.head_dim].iter().all(|n| n.is_multiple_of(4));
        let dx = !with_dx || self.dx_stride.is_multiple_of(4) && self.dx_offset.is_multiple_of(4);
        plain && dx && (spec.rope_rows.is_none() || spec.head_dim.is_multiple_of(16))
    }

    fn dispatch(&self, piece: &Piece, caps: &Caps) -> Dispatch {
        let spec = &self.heads;
        let (row0, row1) = self.token_rows(piece);
        let norm = spec.norm.is_some();
        let rows = |arg: Arg, width: u32| {
            let width = u64::from(width);
            cover(arg, row0 * width, (row1 - row0) * width, caps)
        };
        let (x, x_rest) = if norm { rows(X, spec.x_stride) } else { (Arg::ABSENT.into(), 0) };
        let (dx, dx_rest) = rows(DX, self.dx_stride);
        let (stats, stats_rest) = rows(STATS, 2 * spec.heads);
        let params = SplitHeadsGradParams {
            x_offset: spec.x_offset + x_rest,
            dx_offset: self.dx_offset + dx_rest,
            row0: row0 as u32,
            stats_rest: stats_rest / 2,
            dy_row0: self.dy_row0(piece) as u32,
            head0: piece.head0 as u32,
            head_count: piece.heads as u32,
            t0: piece.t0 as u32,
            t_count: piece.tokens as u32,
            ..self.sizes()
        };
        let all = [&shaders::BASELINE, &shaders::VEC4, &shaders::SOFTWARE];
        let (shader, _) = unit(caps, self.fours(true), all);
        let table = TABLE.when(spec.rope_rows.is_some()).into();
        let windows = [x, WEIGHT.when(norm).into(), table, self.dy_window(piece), dx, stats];
        Dispatch::new(shader, &params, &windows, (piece.heads * piece.tokens).div_ceil(64))
    }

    /// The row of dy at the start of a piece's window.
    fn dy_row0(&self, piece: &Piece) -> u64 {
        let t0 = if piece.heads == 1 { piece.t0 } else { 0 };
        piece.head0 * u64::from(self.heads.padded().0) + t0
    }

    /// Rows of dy, and heads, that the columns of some heads read in a run: from an even row on, which is aligned.
    fn dy_rows(&self, run: Run, (head0, heads): (u64, u64)) -> (u64, u64) {
        let (all, tokens) = (u64::from(self.heads.heads), u64::from(self.heads.tokens));
        let padded = u64::from(self.heads.padded().0);
        let row = |r: u64, head: u64| (r / tokens * all + head) * padded + r % tokens;
        let last = run.row0 + run.rows - 1;
        // In a later group the first head may lie before the last head of an earlier one.
        let first = row(run.row0, head0);
        (first / 2 * 2, row(last, head0 + heads - 1).max(row(run.row0, head0 + heads - 1)) + 1)
    }

    /// Runs of rows with the heads that go together (the first and how many), all of which fit into bindings: first fewer rows, then
    /// fewer heads.
    fn runs(&self, caps: &Caps) -> Result<Vec<(Run, u64, u64)>, KernelError> {
        let sections = self.sections();
        let (all, room) = (u64::from(self.heads.heads), room(caps));
        let width = u64::from(self.heads.x_stride.max(2 * self.heads.heads));
        let dp = u64::from(self.heads.padded().1);
        let most = (room / self.columns()).max(1);
        let longest = (room / width).min(sections.rows.next_multiple_of(PART)) / PART * PART;
        let mut heads = all;
        loop {
            let mut fit = longest;
            while fit > 0 {
                let starts = (0..all).step_by(heads as usize);
                let parts: Vec<(u64, u64)> = starts.map(|first| (first, heads.min(all - first))).collect();
                let runs = sections.runs(fit, most);
                let fits = |run: &Run, part: (u64, u64)| {
                    let (first, end) = self.dy_rows(*run, part);
                    (end - first) * dp <= room
                };
                if runs.iter().all(|run| parts.iter().all(|part| fits(run, *part))) {
                    let with = |run: Run| parts.clone().into_iter().map(move |(first, count)| (run, first, count));
                    return Ok(runs.into_iter().flat_map(with).collect());
                }
                fit = fit / 2 / PART * PART;
            }
            if heads == 1 || longest == 0 {
                let bytes = 4 * (PART * width).max(PART * dp);
                return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes, limit: caps.max_binding });
            }
            heads = heads.div_ceil(2);
        }
    }

    /// The sums of some heads' columns over a run.
    fn sum(&self, sections: &Sections, run: Run, (head0, heads): (u64, u64), caps: &Caps) -> Dispatch {
        let spec = &self.heads;
        let (d, step) = (u64::from(spec.head_dim), self.columns());
        let rows = |arg: Arg, width: u32| {
            let width = u64::from(width);
            cover(arg, run.row0 * width, run.rows * width, caps)
        };
        let (x, x_rest) = rows(X, spec.x_stride);
        let (stats, stats_rest) = rows(STATS, 2 * spec.heads);
        let (dy_row0, dy_end) = self.dy_rows(run, (head0, heads));
        let dp = u64::from(spec.padded().1);
        let dy = DY.window(dy_row0 * dp * 4, (dy_end - dy_row0) * dp * 4);
        let target = |region: u64| cover(PARTS, region + run.section * step, run.sections * step, caps);
        let ((weight, weight_rest), (bias, bias_rest)) = (target(0), target(self.region()));
        let all = [&shaders::COLUMNS, &shaders::COLUMNS4, &shaders::COLUMNS_SOFTWARE];
        let (shader, width) = unit(caps, self.fours(false), all);
        let sizes = self.sizes();
        let params = SplitHeadsGradParams {
            x_offset: spec.x_offset + x_rest,
            row0: run.row0 as u32,
            stats_rest: stats_rest / 2,
            dy_row0: dy_row0 as u32,
            head0: head0 as u32,
            head_count: heads as u32,
            flags: sizes.flags | if run.go_on { GO_ON } else { 0 },
            first: run.row0 as u32,
            m: run.rows as u32,
            section: sections.each as u32,
            step: step as u32,
            weight_rest,
            bias_rest,
            ..sizes
        };
        let windows = [x, TABLE.when(spec.rope_rows.is_some()).into(), dy, stats, weight, bias];
        Dispatch::new(shader, &params, &windows, (run.sections * heads * d / u64::from(width)).div_ceil(64))
    }
}
