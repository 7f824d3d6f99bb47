//! The gradient of [`crate::deform_sample`] with respect to the offsets and weights of each pixel's sampling points. Positions
//! that were clamped to the image have none (OmniX spec, section 8.4). What goes back to field and mask is
//! [`crate::deform_sample_grad_field`].
//!
//! A sampling point's sum over times and channels does not depend on the others: any split gives the same bits.

use omnix_shaders::deform_sample_grad as shaders;

use crate::cover::{cover, room};
use crate::deform_sample::{DeformSample, MAX_SAMPLES};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Offsets in cells `[n, levels, points, 2]`, x then y.
pub const OFFSETS: Arg = crate::deform_sample::OFFSETS;
/// Weights `[n, levels, points]`.
pub const WEIGHTS: Arg = crate::deform_sample::WEIGHTS;
/// Optional u32 `[n]`: flat indices of the pixels.
pub const PIXELS: Arg = crate::deform_sample::PIXELS;
/// `[levels, T, L, 9]`.
pub const FIELD: Arg = crate::deform_sample::FIELD;
/// `[L]`.
pub const MASK: Arg = crate::deform_sample::MASK;
/// Gradient of the result, `[n, 9 T + 1]`.
pub const DTAU: Arg = Arg(5);
/// Output `[n, levels, points, 2]`.
pub const DOFFSETS: Arg = Arg(6);
/// Output `[n, levels, points]`.
pub const DWEIGHTS: Arg = Arg(7);

/// The gradient of this sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeformSampleGrad(pub DeformSample);

impl DeformSampleGrad {
    /// Multiply-adds over cells, times and channels, each counted as two operations.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        self.0.flops()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// As [`DeformSample::record`].
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let sample = self.0;
        sample.check("deform_sample_grad", caps)?;
        let (taps, row) = (sample.taps(), u64::from(sample.times) * 9 + 1);
        let fit = (room(caps) / row.max(taps * 2)).min(MAX_SAMPLES / taps / u64::from(sample.times)).max(1);
        let all = u64::from(sample.n);
        let dispatch = |first: u64| {
            let n = fit.min(all - first);
            let ([offsets, weights, pixels], mut params) = sample.pixels(first, n, caps);
            let (dtau, y_rest) = cover(DTAU, first * row, n * row, caps);
            let (doffsets, _) = cover(DOFFSETS, first * taps * 2, n * taps * 2, caps);
            let (dweights, _) = cover(DWEIGHTS, first * taps, n * taps, caps);
            params.y_rest = y_rest;
            let windows = [offsets, weights, pixels, FIELD.into(), MASK.into(), dtau, doffsets, dweights];
            let operations = 8 * n * taps * row;
            Dispatch::new(&shaders::BASELINE, &params, &windows, (n * taps).div_ceil(64)).of_operations(operations)
        };
        Ok((0..all).step_by(fit as usize).map(dispatch).collect())
    }
}
