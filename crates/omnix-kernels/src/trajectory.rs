//! [`crate::deform_sample`] and [`crate::traj_apply`] in one, for one source image and a range of target times: final
//! points `[nt, n, 3]` and scores, without ever storing tau, which would be the largest tensor of the program.
//!
//! The range is data, not part of the recording: [`WHEN`] holds the image's own time and the first target time, so one
//! recording serves every image and every piece of the times. A pixel's value at a time depends on neither the range nor the
//! other pixels, bit for bit, and sums go in the order of the two kernels.

use omnix_shaders::trajectory as shaders;

use crate::caps::UNIFORM_WINDOW;
use crate::cover::{cover, room};
use crate::deform_sample::{DeformSample, MAX_SAMPLES, RELATIVE};
pub use crate::deform_sample::{OFFSETS, PIXELS, WEIGHTS};
use crate::dispatch::Window;
use crate::traj_apply::{Motion, times_of_window};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// `[levels, T, L, 9]`.
pub const FIELD: Arg = Arg(3);
/// `[L]`.
pub const MASK: Arg = Arg(4);
/// World points `[n, 3]`.
pub const POINTS: Arg = Arg(5);
/// u32 `[2]`: the image's own time, and the first target time. Times past the end count as the last.
pub const WHEN: Arg = Arg(6);
/// Output `[nt, n, 3]`.
pub const Y: Arg = Arg(7);
/// Output `[n]`: the motion score θ.
pub const THETA: Arg = Arg(8);
/// Scratch of [`Trajectory::anchor_words`]: what of a pixel does not depend on the target time.
pub const ANCHOR: Arg = Arg(9);
/// Scratch of [`packed_words`]: the field of the times in question as vec4, for the software variants, which read it through
/// uniform windows, and the GPU's.
pub const PACKED: Arg = Arg(10);

/// 32-bit words of [`PACKED`] for a range of `nt` times: the range and the own time, cells padded to 16 and channels to 12, so
/// that every time of a level starts on a 256-byte boundary.
#[must_use]
pub const fn packed_words(levels: u64, nt: u64, cells: u64) -> u64 {
    levels * (nt + 1) * cells.next_multiple_of(16) * 12
}

/// Levels that the software variants bind, each through a window of its own.
const MAX_WINDOWS: u32 = 4;
/// Times of a workgroup of the software variant that takes several (`TW` in the sidecar file).
const SOFTWARE_TIMES: u64 = 2;

/// Times of an invocation of the GPU variant (`TW` in the sidecar file).
const GPU_TIMES: u64 = 4;

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory {
    /// Pixels, grid and field.
    pub sample: DeformSample,
    /// Target times of the range.
    pub nt: u32,
    /// How points move.
    pub motion: Motion,
}

impl Trajectory {
    /// Multiply-adds of the blends, each counted as two operations; the own time and the mask included.
    #[must_use]
    pub const fn flops(&self) -> u64 {
        8 * self.sample.n as u64 * self.sample.taps() * (9 * (self.nt as u64 + 1) + 1)
    }

    /// 32-bit words of [`ANCHOR`].
    #[must_use]
    pub const fn anchor_words(&self) -> u64 {
        self.sample.n as u64 * 12
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// As [`DeformSample::record`]; also when the range is empty or longer than the field.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "trajectory";
        self.sample.check(kernel, caps)?;
        if self.nt == 0 || self.nt > self.sample.times {
            let reason = format!("a range of {} times; 1 to {} are possible", self.nt, self.sample.times);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (all, all_times, taps) = (u64::from(self.sample.n), u64::from(self.nt), self.sample.taps());
        let fit = (room(caps) / (taps * 2).max(12)).min((MAX_SAMPLES / taps).max(1)).min(all);
        if fit == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: 48, limit: caps.max_binding });
        }
        let times = times_of_window(fit, all, caps).min(MAX_SAMPLES / taps / fit).clamp(1, all_times);
        let windows = self.slots_of_window(caps);
        let mut out = Vec::new();
        let gpu = self.packs_for_gpu(caps);
        if windows.is_some() || gpu {
            out.extend((0..u64::from(self.sample.levels)).map(|level| self.pack(level, caps)));
        }
        // Times of a dispatch: one window of slots where the field is packed, whole workgroups if there is a choice.
        let times = match windows.map(|slots| times.min(slots)) {
            Some(slots) if slots >= SOFTWARE_TIMES => slots / SOFTWARE_TIMES * SOFTWARE_TIMES,
            Some(slots) => slots,
            None => times,
        };
        for first in (0..all).step_by(fit as usize) {
            let n = fit.min(all - first);
            out.push(self.own((first, n), windows.is_some(), caps));
            for t0 in (0..all_times).step_by(times as usize) {
                out.push(self.targets((first, n), (t0, times.min(all_times - t0)), windows.is_some(), caps));
            }
        }
        Ok(out)
    }

    /// Cells of a slot of [`PACKED`], padded.
    const fn padded_cells(&self) -> u64 {
        self.sample.cells().next_multiple_of(16)
    }

    /// 32-bit words of one level of [`PACKED`].
    const fn level_words(&self) -> u64 {
        packed_words(1, self.nt as u64, self.sample.cells())
    }

    /// Slots that one uniform window holds, where this device reads the field through them.
    fn slots_of_window(&self, caps: &Caps) -> Option<u64> {
        let slots = UNIFORM_WINDOW / (self.padded_cells() * 48);
        let fits = slots > 0 && self.sample.levels <= MAX_WINDOWS && self.level_words() <= room(caps);
        (caps.tier == Tier::Software && fits).then_some(slots)
    }

    /// Whether the GPU variant reads the packed field here: all levels of the range through one binding.
    fn packs_for_gpu(&self, caps: &Caps) -> bool {
        caps.tier == Tier::Gpu && u64::from(self.sample.levels) * self.level_words() <= room(caps)
    }

    /// One level of the field, packed.
    fn pack(&self, level: u64, caps: &Caps) -> Dispatch {
        let (cells, slots) = (self.sample.cells(), u64::from(self.nt) + 1);
        let words = u64::from(self.sample.times) * cells * 9;
        let (_, mut params) = self.sample.pixels(0, 1, caps);
        let (field, x_rest) = cover(FIELD, level * words, words, caps);
        let (packed, y_rest) = cover(PACKED, level * self.level_words(), self.level_words(), caps);
        (params.nt, params.slot) = (self.nt, (self.padded_cells() * 3) as u32);
        (params.x_rest, params.y_rest) = (x_rest, y_rest / 4);
        Dispatch::new(&shaders::PACK, &params, &[field, MASK.into(), WHEN.into(), packed], (slots * cells).div_ceil(64))
    }

    /// The window of each level that starts at `slot`; levels that do not exist repeat the first.
    fn windows(&self, slot: u64) -> [Window; MAX_WINDOWS as usize] {
        [0, 1, 2, 3].map(|level| {
            let level = if level < u64::from(self.sample.levels) { level } else { 0 };
            PACKED.window(level * self.level_words() * 4 + slot * self.padded_cells() * 48, UNIFORM_WINDOW)
        })
    }

    /// What of the pixels does not depend on the target time.
    fn own(&self, (first, n): (u64, u64), packed: bool, caps: &Caps) -> Dispatch {
        let ([offsets, weights, pixels], mut params) = self.sample.pixels(first, n, caps);
        // The score beside the nine numbers of the own time.
        let operations = 8 * n * self.sample.taps() * 10;
        let (x, x_rest) = cover(POINTS, first * 3, n * 3, caps);
        let (anchor, y_rest) = cover(ANCHOR, first * 12, n * 12, caps);
        params.x_rest = x_rest;
        params.y_rest = y_rest / 4;
        params.min_norm = self.motion.min_norm;
        params.flags |= if self.motion.relative { RELATIVE } else { 0 };
        if packed {
            params.nt = 1;
            let [a, b, c, d] = self.windows(u64::from(self.nt));
            let windows = [offsets, weights, a, b, c, d, pixels, x, anchor];
            return Dispatch::new(&shaders::SOFTWARE_OWN, &params, &windows, n.div_ceil(8)).of_operations(operations);
        }
        let windows = [offsets, weights, FIELD.into(), WHEN.into(), pixels, MASK.into(), x, anchor];
        Dispatch::new(&shaders::OWN, &params, &windows, n.div_ceil(64)).of_operations(operations)
    }

    /// The pixels at target times `t0..t0 + nt` of the range.
    fn targets(&self, (first, n): (u64, u64), (t0, nt): (u64, u64), packed: bool, caps: &Caps) -> Dispatch {
        let ([offsets, weights, _], mut params) = self.sample.pixels(first, n, caps);
        let operations = 8 * n * self.sample.taps() * 9 * nt;
        let all = u64::from(self.sample.n);
        let (anchor, x_rest) = cover(ANCHOR, first * 12, n * 12, caps);
        let (y, y_rest) = cover(Y, (t0 * all + first) * 3, ((nt - 1) * all + n) * 3, caps);
        let (theta, theta_rest) = cover(THETA, first, n, caps);
        params.x_rest = x_rest / 4;
        params.y_rest = y_rest;
        params.theta_rest = theta_rest;
        (params.nt, params.skip, params.step) = (nt as u32, t0 as u32, (all * 3) as u32);
        (params.gate, params.threshold) = self.motion.gate.code();
        params.min_norm = self.motion.min_norm;
        (params.slot, params.level) = ((self.padded_cells() * 3) as u32, (self.level_words() / 4) as u32);
        if self.packs_for_gpu(caps) {
            let windows = [offsets, weights, PACKED.into(), anchor, y, theta];
            let groups = (n * nt.div_ceil(GPU_TIMES)).div_ceil(64);
            return Dispatch::new(&shaders::GPU, &params, &windows, groups).of_operations(operations);
        }
        if packed {
            let [a, b, c, d] = self.windows(t0);
            let windows = [offsets, weights, a, b, c, d, anchor, y, theta];
            // Points are found once for several times; a rest goes one by one.
            let (shader, tw) = match nt % SOFTWARE_TIMES {
                0 => (&shaders::SOFTWARE_2, SOFTWARE_TIMES),
                _ => (&shaders::SOFTWARE_1, 1),
            };
            let groups = n.div_ceil(8) * nt.div_ceil(tw);
            return Dispatch::new(shader, &params, &windows, groups).of_operations(operations);
        }
        let windows = [offsets, weights, FIELD.into(), WHEN.into(), anchor, y, theta];
        Dispatch::new(&shaders::BASELINE, &params, &windows, (n * nt).div_ceil(64)).of_operations(operations)
    }
}
