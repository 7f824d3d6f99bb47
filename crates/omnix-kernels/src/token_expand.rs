//! `z[t, r, :] = q[r, :] · (1 + alpha[r] · scale[t, :]) + kappa[r] · shift[t, :]`: every token once for every target time,
//! marked with that time's code. With one gain per token and no scale this is OmniX's expansion (spec, section 5.4); the rest
//! serves its AdaLN ablations (section 9).

use omnix_shaders::token_expand as shaders;

use crate::cover::{cover, room, steps, unit};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Tokens `[m, d]`.
pub const Q: Arg = Arg(0);
/// Optional `[T, d]`; 0 where absent.
pub const SCALE: Arg = Arg(1);
/// `[T, d]`.
pub const SHIFT: Arg = Arg(2);
/// Optional `[m]`; 1 where absent.
pub const ALPHA: Arg = Arg(3);
/// Optional `[m]`; 1 where absent.
pub const KAPPA: Arg = Arg(4);
/// Output `[T, m, d]`.
pub const Z: Arg = Arg(5);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TokenExpand {
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
    /// `Params` of `shaders/token_expand`.
    pub struct TokenExpandParams {
        rows: u32,
        times: u32,
        stride: u32,
        d: u32,
        pieces: u32,
        steps: u32,
        flags: u32,
        q_rest: u32,
        scale_rest: u32,
        shift_rest: u32,
        alpha_rest: u32,
        kappa_rest: u32,
        z_rest: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

const HAS_SCALE: u32 = 1;
const HAS_ALPHA: u32 = 2;
const HAS_KAPPA: u32 = 4;

impl TokenExpand {
    /// Bytes read once and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let (m, d, times) = (self.m as u64, self.d as u64, self.times as u64);
        let rows = m + times * (1 + self.scale as u64) + times * m;
        4 * (rows * d + m * (self.alpha as u64 + self.kappa as u64))
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or one row is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "token_expand";
        if self.m == 0 || self.d == 0 || self.times == 0 {
            let reason = format!("{} tokens of {} channels at {} times; none may be 0", self.m, self.d, self.times);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (m, d, all_times) = (u64::from(self.m), u64::from(self.d), u64::from(self.times));
        let fit = room(caps) / d;
        if fit == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: d * 4, limit: caps.max_binding });
        }
        // All tokens of several times, or some tokens of one.
        let (rows, times) = if fit >= m { (m, (fit / m).min(all_times)) } else { (fit, 1) };
        let mut out = Vec::new();
        for t0 in (0..all_times).step_by(times as usize) {
            for r0 in (0..m).step_by(rows as usize) {
                out.push(self.dispatch((r0, rows.min(m - r0)), (t0, times.min(all_times - t0)), caps));
            }
        }
        Ok(out)
    }

    fn dispatch(&self, (r0, rows): (u64, u64), (t0, times): (u64, u64), caps: &Caps) -> Dispatch {
        let (m, d) = (u64::from(self.m), u64::from(self.d));
        let (shader, unit) =
            unit(caps, self.d.is_multiple_of(4), [&shaders::WORDS, &shaders::VEC4, &shaders::SOFTWARE]);
        let (q, q_rest) = cover(Q, r0 * d, rows * d, caps);
        let (scale, scale_rest) = cover(SCALE.when(self.scale), t0 * d, times * d, caps);
        let (shift, shift_rest) = cover(SHIFT, t0 * d, times * d, caps);
        let (alpha, alpha_rest) = cover(ALPHA.when(self.alpha), r0, rows, caps);
        let (kappa, kappa_rest) = cover(KAPPA.when(self.kappa), r0, rows, caps);
        let (z, z_rest) = cover(Z, (t0 * m + r0) * d, ((times - 1) * m + rows) * d, caps);
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let width = self.d / unit;
        let steps = steps(caps, width);
        let pieces = width.div_ceil(8 * steps);
        let params = TokenExpandParams {
            rows: rows as u32,
            times: times as u32,
            stride: self.m,
            d: width,
            pieces,
            steps,
            flags: set(self.scale, HAS_SCALE) | set(self.alpha, HAS_ALPHA) | set(self.kappa, HAS_KAPPA),
            q_rest: q_rest / unit,
            scale_rest: scale_rest / unit,
            shift_rest: shift_rest / unit,
            alpha_rest,
            kappa_rest,
            z_rest: z_rest / unit,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        let groups = (rows * times * u64::from(pieces)).div_ceil(8);
        Dispatch::new(shader, &params, &[q, scale, shift, alpha, kappa, z], groups)
    }
}
