//! The gradient of [`crate::deform_sample`] with respect to field and mask: what each pixel adds to the cells of its sampling points.
//!
//! Which pixels reach a cell is not known, so they are scattered, without atomics: the pixels are cut into parts (a number that
//! follows from n alone), each part adds into copies of its own, one for each level, and the copies are added in order. An
//! invocation owns one column of a copy and walks the part's pixels in order. Every sum has one order, whatever the device's
//! limits: no split changes a bit.

use omnix_shaders::deform_sample_grad_field as shaders;

use crate::cover::{cover, room};
use crate::deform_sample::{DeformParams, DeformSample, MAX_SAMPLES};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Offsets in cells `[n, levels, points, 2]`, x then y.
pub const OFFSETS: Arg = crate::deform_sample::OFFSETS;
/// Weights `[n, levels, points]`.
pub const WEIGHTS: Arg = crate::deform_sample::WEIGHTS;
/// Optional u32 `[n]`: flat indices of the pixels.
pub const PIXELS: Arg = crate::deform_sample::PIXELS;
/// Gradient of the result, `[n, 9 T + 1]`.
pub const DTAU: Arg = Arg(3);
/// Output `[levels, T, L, 9]`.
pub const DFIELD: Arg = Arg(4);
/// Output `[L]`.
pub const DMASK: Arg = Arg(5);
/// Scratch of [`DeformSampleGradField::scratch`] words.
pub const COPIES: Arg = Arg(6);

/// The gradient of this sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeformSampleGradField(pub DeformSample);

const CLEAR: u32 = 4;
/// Most parts, each with its copies, and fewest pixels of a part: parallel enough for a GPU, while the copies take
/// 32 times the field at most.
const MOST_PARTS: u64 = 32;
const FEWEST_PIXELS: u64 = 1024;

impl DeformSampleGradField {
    /// Multiply-adds of the scatter, each counted as two operations.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        self.0.flops()
    }

    /// Pixels of a part.
    fn part(&self) -> u64 {
        u64::from(self.0.n).div_ceil(MOST_PARTS).max(FEWEST_PIXELS)
    }

    fn parts(&self) -> u64 {
        u64::from(self.0.n).div_ceil(self.part())
    }

    /// Words of the copy of one part and level.
    fn copy(&self) -> u64 {
        self.0.cells() * self.columns().next_multiple_of(4)
    }

    fn columns(&self) -> u64 {
        u64::from(self.0.times) * 9 + 1
    }

    /// Words of [`COPIES`].
    #[must_use]
    pub fn scratch(&self) -> u64 {
        self.parts() * u64::from(self.0.levels) * self.copy()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// As [`DeformSample::record`], or when the copy of one level is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "deform_sample_grad_field";
        self.0.check(kernel, caps)?;
        let room = room(caps);
        if self.copy() > room {
            return Err(KernelError::RowTooLarge { kernel, bytes: self.copy() * 4, limit: caps.max_binding });
        }
        let mut out = Vec::new();
        self.scatter(caps, &mut out);
        self.sum(caps, &mut out);
        Ok(out)
    }

    /// The passes over pixels.
    fn scatter(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let sample = &self.0;
        let (room, levels, part, all) = (room(caps), u64::from(sample.levels), self.part(), u64::from(sample.n));
        let row = self.columns().max(sample.taps() * 2);
        // As many whole parts as windows hold, else some levels of one; of each part as many pixels as windows hold and a
        // driver waits for.
        let parts = (room / (part * row)).min(room / (levels * self.copy())).min(self.parts());
        let slots = if parts > 0 { parts * levels } else { (room / self.copy()).min(levels) };
        let most = MAX_SAMPLES / sample.taps() / u64::from(sample.times) / parts.max(1);
        let pixels = part.min(room / row / parts.max(1)).min(most).max(1);
        let all_slots = self.parts() * levels;
        let mut s0 = 0;
        while s0 < all_slots {
            // Without whole parts a dispatch stays within one.
            let end = if parts > 0 { all_slots } else { (s0 / levels + 1) * levels };
            let count = slots.min(end - s0);
            let first_part = s0 / levels;
            let last_part = (s0 + count - 1) / levels;
            for from in (0..part).step_by(pixels as usize) {
                let (first, n) = (first_part * part + from, pixels.min(part - from));
                // The last part may be shorter than this piece starts at.
                let last = (last_part * part + from + n).min(all).max(first);
                if last > first || from == 0 {
                    out.push(self.piece((s0, count), (first, last - first, n), from == 0, caps));
                }
            }
            s0 += count;
        }
    }

    /// The slots `s0..s0 + count`: of each part n pixels, of which the first part's first is `first`; `reach` pixels to the last.
    fn piece(&self, (s0, count): (u64, u64), (first, reach, n): (u64, u64, u64), clear: bool, caps: &Caps) -> Dispatch {
        let levels = u64::from(self.0.levels);
        // Columns of an invocation, invocations of a workgroup: `COLUMNS` and `LANES` in the sidecar file.
        let (shader, unit, lanes) = match caps.tier {
            Tier::Software => (&shaders::SOFTWARE, 4, 8),
            _ => (&shaders::BASELINE, 1, 64),
        };
        let ([offsets, weights, pixels], mut params) = self.0.pixels(first, reach, caps);
        let (dtau, y_rest) = cover(DTAU, first * self.columns(), reach * self.columns(), caps);
        let (copies, x_rest) = cover(COPIES, s0 * self.copy(), count * self.copy(), caps);
        params.n = n as u32;
        params.step = self.part() as u32;
        params.theta_rest = reach as u32;
        params.nt = count as u32;
        params.skip = (s0 % levels) as u32;
        params.flags |= if clear { CLEAR } else { 0 };
        (params.y_rest, params.x_rest) = (y_rest, x_rest / unit as u32);
        let groups = count * self.columns().div_ceil(unit).div_ceil(lanes);
        let operations = 8 * count.div_ceil(levels) * n * self.0.taps() * self.columns();
        Dispatch::new(shader, &params, &[offsets, weights, pixels, dtau, copies], groups).of_operations(operations)
    }

    /// The passes over copies.
    fn sum(&self, caps: &Caps, out: &mut Vec<Dispatch>) {
        let all = self.parts() * u64::from(self.0.levels);
        let fit = room(caps) / self.copy();
        for s0 in (0..all).step_by(fit as usize) {
            let count = fit.min(all - s0);
            let (copies, x_rest) = cover(COPIES, s0 * self.copy(), count * self.copy(), caps);
            let params = DeformParams {
                skip: s0 as u32,
                nt: count as u32,
                flags: if s0 == 0 { CLEAR } else { 0 },
                x_rest,
                ..self.0.pixels(0, 1, caps).1
            };
            let groups = (self.0.field_words() + self.0.cells()).div_ceil(64);
            out.push(Dispatch::new(&shaders::SUM, &params, &[copies, DFIELD.into(), DMASK.into()], groups));
        }
    }
}
