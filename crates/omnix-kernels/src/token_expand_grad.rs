//! The gradient of [`crate::token_expand`], `z[t, r, :] = q[r, :] · (1 + alpha[r] · scale[t, :]) + kappa[r] · shift[t, :]`: of
//! the tokens, of the two numbers of each, and of the two rows of each time. What is absent has the value 0 (scale) or 1, and
//! its gradient is that at this value.
//!
//! Times are summed in order, tokens in blocks of a fixed length whose sums are added in order: no split changes a bit.
//! The equations are in `shaders/lib/token_expand_grad_params.wgsl`.

use bytemuck::Zeroable as _;
use omnix_shaders::token_expand_grad as shaders;

use crate::cover::{cover, room, unit};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Tokens `[m, d]`.
pub const Q: Arg = Arg(0);
/// Optional `[T, d]`.
pub const SCALE: Arg = Arg(1);
/// `[T, d]`.
pub const SHIFT: Arg = Arg(2);
/// Optional `[m]`.
pub const ALPHA: Arg = Arg(3);
/// Optional `[m]`.
pub const KAPPA: Arg = Arg(4);
/// Gradient of the result, `[T, m, d]`.
pub const DZ: Arg = Arg(5);
/// Output `[m, d]`: gradient of the tokens.
pub const DQ: Arg = Arg(6);
/// Output `[m, 2]`: gradients of alpha and kappa.
pub const DROW: Arg = Arg(7);
/// Output `[T, 2, d]`: gradients of scale and shift.
pub const DTIME: Arg = Arg(8);
/// Scratch `[m, 3, d]`.
pub const SUMS: Arg = Arg(9);
/// Scratch `[T, blocks, 2, d]`; see [`TokenExpandGrad::blocks`].
pub const PARTS: Arg = Arg(10);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TokenExpandGrad {
    /// Tokens.
    pub m: u32,
    /// Channels.
    pub d: u32,
    /// Target times.
    pub times: u32,
    /// Whether [`SCALE`] is there.
    pub scale: bool,
    /// Whether [`ALPHA`] is there.
    pub alpha: bool,
    /// Whether [`KAPPA`] is there.
    pub kappa: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/token_expand_grad`.
    pub struct TokenExpandGradParams {
        rows: u32,
        times: u32,
        stride: u32,
        d: u32,
        flags: u32,
        block: u32,
        parts: u32,
        q_rest: u32,
        scale_rest: u32,
        shift_rest: u32,
        alpha_rest: u32,
        kappa_rest: u32,
        dz_rest: u32,
        sums_rest: u32,
        out_rest: u32,
        row_rest: u32,
    }
}

const HAS_SCALE: u32 = 1;
const HAS_ALPHA: u32 = 2;
const HAS_KAPPA: u32 = 4;
const GO_ON: u32 = 8;
/// Tokens of a block.
const BLOCK: u64 = 64;

impl TokenExpandGrad {
    /// Blocks of tokens.
    #[must_use]
    pub const fn blocks(&self) -> u32 {
        self.m.div_ceil(BLOCK as u32)
    }

    /// Bytes read and written: dz twice, the sums twice, the rest once.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let (m, d, times) = (self.m as u64, self.d as u64, self.times as u64);
        4 * (2 * times * m * d + 9 * m * d + 4 * times * (1 + self.blocks() as u64) * d)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or the sums of one token or of one time are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "token_expand_grad";
        if self.m == 0 || self.d == 0 || self.times == 0 {
            let reason = format!("{} tokens of {} channels at {} times; none may be 0", self.m, self.d, self.times);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (d, blocks) = (u64::from(self.d), u64::from(self.blocks()));
        let row = 3.max(2 * blocks) * d;
        if row > room(caps) {
            return Err(KernelError::RowTooLarge { kernel, bytes: row * 4, limit: caps.max_binding });
        }
        let mut out = Vec::new();
        self.over_times(caps, &mut out);
        self.over_channels(caps, &mut out);
        self.over_tokens(caps, &mut out);
        self.over_blocks(caps, &mut out);
        Ok(out)
    }

    fn params(&self) -> TokenExpandGradParams {
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        TokenExpandGradParams {
            stride: self.m,
            d: self.d,
            flags: set(self.scale, HAS_SCALE) | set(self.alpha, HAS_ALPHA) | set(self.kappa, HAS_KAPPA),
            block: BLOCK as u32,
            ..TokenExpandGradParams::zeroed()
        }
    }

    fn over_times(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (m, d, all_times) = (u64::from(self.m), u64::from(self.d), u64::from(self.times));
        let fit = room(caps) / d;
        let rows = (fit / 3).min(m);
        let times = (1 + (fit - rows) / m).min(all_times);
        for r0 in (0..m).step_by(rows as usize) {
            for t0 in (0..all_times).step_by(times as usize) {
                let (rows, times) = (rows.min(m - r0), times.min(all_times - t0));
                let (shader, unit) = unit(
                    caps,
                    self.d.is_multiple_of(4),
                    [&shaders::SUMS, &shaders::SUMS_VEC4, &shaders::SUMS_SOFTWARE],
                );
                let mut params = self.params();
                params.d = self.d / unit;
                let (scale, scale_rest) = cover(SCALE.when(self.scale), t0 * d, times * d, caps);
                let (shift, shift_rest) = cover(SHIFT, t0 * d, times * d, caps);
                let (dz, dz_rest) = cover(DZ, (t0 * m + r0) * d, ((times - 1) * m + rows) * d, caps);
                let (sums, out_rest) = cover(SUMS, r0 * 3 * d, rows * 3 * d, caps);
                (params.rows, params.times) = (rows as u32, times as u32);
                params.flags |= if t0 > 0 { GO_ON } else { 0 };
                (params.scale_rest, params.shift_rest) = (scale_rest / unit, shift_rest / unit);
                (params.dz_rest, params.out_rest) = (dz_rest / unit, out_rest / unit);
                let groups = (rows * d / u64::from(unit)).div_ceil(64);
                out.push(Dispatch::new(shader, &params, &[scale, shift, dz, sums], groups));
            }
        }
    }

    fn over_channels(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (m, d) = (u64::from(self.m), u64::from(self.d));
        let fit = (room(caps) / (3 * d)).min(m);
        for r0 in (0..m).step_by(fit as usize) {
            let rows = fit.min(m - r0);
            let mut params = self.params();
            let (q, q_rest) = cover(Q, r0 * d, rows * d, caps);
            let (alpha, alpha_rest) = cover(ALPHA.when(self.alpha), r0, rows, caps);
            let (sums, sums_rest) = cover(SUMS, r0 * 3 * d, rows * 3 * d, caps);
            let (dq, _) = cover(DQ, r0 * d, rows * d, caps);
            let (drow, row_rest) = cover(DROW, r0 * 2, rows * 2, caps);
            params.rows = rows as u32;
            (params.q_rest, params.alpha_rest) = (q_rest, alpha_rest);
            (params.sums_rest, params.row_rest) = (sums_rest, row_rest);
            out.push(Dispatch::new(&shaders::TOKENS, &params, &[q, alpha, sums, dq, drow], rows));
        }
    }

    fn over_tokens(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (m, d, all_times) = (u64::from(self.m), u64::from(self.d), u64::from(self.times));
        let (fit, blocks) = (room(caps) / d, u64::from(self.blocks()));
        // All tokens of several times, whole blocks of one time, or some tokens of a block.
        let (rows, times) = if fit >= m.max(2 * blocks) {
            (m, (fit / m.max(2 * blocks)).min(all_times))
        } else {
            (if fit >= BLOCK { fit / BLOCK * BLOCK } else { fit }, 1)
        };
        for t0 in (0..all_times).step_by(times as usize) {
            let times = times.min(all_times - t0);
            let mut r0 = 0;
            while r0 < m {
                let end = if rows < BLOCK { r0 / BLOCK * BLOCK + BLOCK } else { m };
                let rows = rows.min(end.min(m) - r0);
                let parts = rows.div_ceil(BLOCK);
                let (shader, unit) = unit(
                    caps,
                    self.d.is_multiple_of(4),
                    [&shaders::PARTS, &shaders::PARTS_VEC4, &shaders::PARTS_SOFTWARE],
                );
                let mut params = self.params();
                params.d = self.d / unit;
                let (q, q_rest) = cover(Q, r0 * d, rows * d, caps);
                let (alpha, alpha_rest) = cover(ALPHA.when(self.alpha), r0, rows, caps);
                let (kappa, kappa_rest) = cover(KAPPA.when(self.kappa), r0, rows, caps);
                let (dz, dz_rest) = cover(DZ, (t0 * m + r0) * d, ((times - 1) * m + rows) * d, caps);
                let first = (t0 * blocks + r0 / BLOCK) * 2 * d;
                let (to, out_rest) = cover(PARTS, first, times * parts * 2 * d, caps);
                (params.rows, params.times, params.parts) = (rows as u32, times as u32, parts as u32);
                params.flags |= if r0.is_multiple_of(BLOCK) { 0 } else { GO_ON };
                (params.q_rest, params.alpha_rest, params.kappa_rest) = (q_rest / unit, alpha_rest, kappa_rest);
                (params.dz_rest, params.out_rest) = (dz_rest / unit, out_rest / unit);
                let groups = (times * parts * d / u64::from(unit)).div_ceil(64);
                out.push(Dispatch::new(shader, &params, &[q, alpha, kappa, dz, to], groups));
                r0 += rows;
            }
        }
    }

    fn over_blocks(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (d, all_times, blocks) = (u64::from(self.d), u64::from(self.times), u64::from(self.blocks()));
        let fit = (room(caps) / (blocks * 2 * d)).min(all_times);
        for t0 in (0..all_times).step_by(fit as usize) {
            let times = fit.min(all_times - t0);
            let mut params = self.params();
            let (from, sums_rest) = cover(PARTS, t0 * blocks * 2 * d, times * blocks * 2 * d, caps);
            let (to, out_rest) = cover(DTIME, t0 * 2 * d, times * 2 * d, caps);
            (params.times, params.parts) = (times as u32, self.blocks());
            (params.sums_rest, params.out_rest) = (sums_rest, out_rest);
            out.push(Dispatch::new(&shaders::TIMES, &params, &[from, to], (times * 2 * d).div_ceil(64)));
        }
    }
}
