//! The field and the mask of one source image blended at each pixel's sampling points (OmniX spec, section 8.2):
//! `tau[i, 9 t + c] = Σ weights[i, l, q] · B(field[l, t, :, c])`, `tau[i, 9 T] = Σ weights[i, l, q] · B(mask)`, the usual
//! multi-scale deformable operator with one head. Positions clamp to the image before, cells outside count as zero after.
//!
//! [`OFFSETS`], [`WEIGHTS`] and [`TAU`] have one row a listed pixel, in the order of the list (every pixel of the image, row
//! by row, where there is no list). A pixel's sums do not depend on the others: any split gives the same bits.

use bytemuck::Zeroable as _;
use omnix_shaders::deform_sample as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Offsets in cells `[n, levels, points, 2]`, x then y.
pub const OFFSETS: Arg = Arg(0);
/// Weights `[n, levels, points]`, after their softmax.
pub const WEIGHTS: Arg = Arg(1);
/// Optional u32 `[n]`: flat indices, row · width + column, of the pixels.
pub const PIXELS: Arg = Arg(2);
/// `[levels, T, L, 9]`.
pub const FIELD: Arg = Arg(3);
/// `[L]`.
pub const MASK: Arg = Arg(4);
/// Output `[n, 9 T + 1]`.
pub const TAU: Arg = Arg(5);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeformSample {
    /// Pixels: all of the image, or as many as are listed.
    pub n: u32,
    /// Pixels of a row of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
    /// Rows of the grid.
    pub hp: u32,
    /// Columns of the grid.
    pub wp: u32,
    /// Field levels.
    pub levels: u32,
    /// Sampling points of a level.
    pub points: u32,
    /// Times of the field, T.
    pub times: u32,
    /// Whether [`PIXELS`] is there.
    pub listed: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/deform_sample` and `shaders/trajectory`.
    pub struct DeformParams {
        pub(crate) n: u32,
        pub(crate) first: u32,
        pub(crate) width: u32,
        pub(crate) height: u32,
        pub(crate) hp: u32,
        pub(crate) wp: u32,
        pub(crate) levels: u32,
        pub(crate) points: u32,
        pub(crate) times: u32,
        pub(crate) nt: u32,
        pub(crate) skip: u32,
        pub(crate) flags: u32,
        pub(crate) o_rest: u32,
        pub(crate) w_rest: u32,
        pub(crate) i_rest: u32,
        pub(crate) y_rest: u32,
        pub(crate) x_rest: u32,
        pub(crate) theta_rest: u32,
        pub(crate) step: u32,
        pub(crate) gate: u32,
        pub(crate) threshold: f32,
        pub(crate) min_norm: f32,
        pub(crate) slot: u32,
        pub(crate) level: u32,
    }
}

pub(crate) const LISTED: u32 = 1;
pub(crate) const RELATIVE: u32 = 2;

/// Drivers take a device for hung after some seconds in one dispatch: no dispatch samples more points than this, about
/// two seconds on a small processor.
pub(crate) const MAX_SAMPLES: u64 = 36 << 20;

impl DeformSample {
    /// Sampling points of a pixel.
    #[must_use]
    pub const fn taps(&self) -> u64 {
        self.levels as u64 * self.points as u64
    }

    /// Multiply-adds of the blends, each counted as two operations; positions not counted.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        self.operations(self.n as u64)
    }

    const fn operations(&self, pixels: u64) -> u64 {
        8 * pixels * self.taps() * (9 * self.times as u64 + 1)
    }

    /// Checks the sizes, and that the whole field can be bound.
    pub(crate) fn check(&self, kernel: &'static str, caps: &Caps) -> Result<(), KernelError> {
        let Self { n, width, height, hp, wp, levels, points, times, listed } = *self;
        let fail = |reason: String| Err(KernelError::Unsupported { kernel, reason });
        if [n, width, height, hp, wp, levels, points, times].contains(&0) {
            return fail(format!(
                "{n} pixels of {width} x {height}, {levels} levels of {points} points, {times} times, a grid of {wp} x {hp}; \
                 none may be 0"
            ));
        }
        let pixels = u64::from(width) * u64::from(height);
        if pixels > u64::from(u32::MAX) || !listed && u64::from(n) != pixels {
            return fail(format!("{n} pixels without a list, but the image has {width} x {height}"));
        }
        let row = (self.taps() * 2).max(u64::from(times) * 9 + 1);
        for words in [self.field_words(), row] {
            if words > room(caps) {
                return Err(KernelError::RowTooLarge { kernel, bytes: words * 4, limit: caps.max_binding });
            }
        }
        Ok(())
    }

    /// 32-bit words of [`FIELD`].
    #[must_use]
    pub const fn field_words(&self) -> u64 {
        self.levels as u64 * self.times as u64 * self.cells() * 9
    }

    /// Cells of the grid.
    #[must_use]
    pub const fn cells(&self) -> u64 {
        self.hp as u64 * self.wp as u64
    }

    /// Windows of offsets, weights and the list for pixels `first..first + n`, and the parameters that follow.
    pub(crate) fn pixels(&self, first: u64, n: u64, caps: &Caps) -> ([crate::dispatch::Window; 3], DeformParams) {
        let taps = self.taps();
        let (offsets, o_rest) = cover(OFFSETS, first * taps * 2, n * taps * 2, caps);
        let (weights, w_rest) = cover(WEIGHTS, first * taps, n * taps, caps);
        let (pixels, i_rest) = cover(PIXELS.when(self.listed), first, n, caps);
        let params = DeformParams {
            n: n as u32,
            first: first as u32,
            width: self.width,
            height: self.height,
            hp: self.hp,
            wp: self.wp,
            levels: self.levels,
            points: self.points,
            times: self.times,
            flags: if self.listed { LISTED } else { 0 },
            o_rest,
            w_rest,
            i_rest,
            ..DeformParams::zeroed()
        };
        ([offsets, weights, pixels], params)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, there is no list and `n` is not the image's, or the field or a row of tau is larger than the
    /// device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.check("deform_sample", caps)?;
        let row = u64::from(self.times) * 9 + 1;
        let fit = (room(caps) / row.max(self.taps() * 2)).min(MAX_SAMPLES / self.taps() / u64::from(self.times)).max(1);
        let all = u64::from(self.n);
        let dispatch = |first: u64| {
            let n = fit.min(all - first);
            let ([offsets, weights, pixels], mut params) = self.pixels(first, n, caps);
            let (tau, y_rest) = cover(TAU, first * row, n * row, caps);
            params.y_rest = y_rest;
            let windows = [offsets, weights, pixels, FIELD.into(), MASK.into(), tau];
            let groups = (n * (u64::from(self.times) + 1)).div_ceil(64);
            Dispatch::new(&shaders::BASELINE, &params, &windows, groups).of_operations(self.operations(n))
        };
        Ok((0..all).step_by(fit as usize).map(dispatch).collect())
    }
}
