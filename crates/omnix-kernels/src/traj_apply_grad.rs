//! The gradient of [`crate::traj_apply`]: of the moved points and the scores to tau and to the points (OmniX spec, sections 8.3
//! and 8.4). A hard gate is straight-through: its value decides which way the gradient of a point goes, and its own gradient is
//! that of the score. Below the floor of a norm the division is by a constant.
//!
//! A pixel's times are summed in order, in one dispatch or several: no split changes a bit.

use omnix_shaders::traj_apply_grad as shaders;

use crate::cover::{cover, room};
use crate::traj_apply::{Motion, times_of_window};
use crate::{Arg, Caps, Dispatch, KernelError};

/// `[n, 9 T + 1]`: six of rotation and three of translation per time, then the motion score.
pub const TAU: Arg = Arg(0);
/// World points `[n, 3]`.
pub const POINTS: Arg = Arg(1);
/// u32 `[1]` or longer: the image's own time is the first (times past the end count as the last).
pub const WHEN: Arg = Arg(2);
/// Gradient of the moved points, `[T, n, 3]`.
pub const DY: Arg = Arg(3);
/// Optional gradient of the scores, `[n]`.
pub const DTHETA: Arg = Arg(4);
/// Output `[n, 9 T + 1]`.
pub const DTAU: Arg = Arg(5);
/// Output `[n, 3]`.
pub const DPOINTS: Arg = Arg(6);
/// Scratch `[n, 10]`.
pub const STATE: Arg = Arg(7);

/// Words of [`STATE`] of a pixel.
pub const STATE_WORDS: u32 = 10;

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajApplyGrad {
    /// Points.
    pub n: u32,
    /// Target times, T.
    pub times: u32,
    /// How points move.
    pub motion: Motion,
    /// Whether [`DTHETA`] is there.
    pub theta: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/traj_apply_grad`.
    pub struct TrajApplyGradParams {
        n: u32,
        times: u32,
        t0: u32,
        nt: u32,
        step: u32,
        relative: u32,
        gate: u32,
        threshold: f32,
        min_norm: f32,
        tau_rest: u32,
        x_rest: u32,
        dy_rest: u32,
        theta_rest: u32,
        state_rest: u32,
        flags: u32,
        pad0: u32,
    }
}

const HAS_THETA: u32 = 1;
const GO_ON: u32 = 2;
const LAST: u32 = 4;

impl TrajApplyGrad {
    /// Bytes read and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.n as u64 * (21 * self.times as u64 + 9)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or a row of tau is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "traj_apply_grad";
        if self.n == 0 || self.times == 0 {
            let reason = format!("{} points at {} times; none may be 0", self.n, self.times);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (all, all_times) = (u64::from(self.n), u64::from(self.times));
        let row = (all_times * 9 + 1).max(u64::from(STATE_WORDS));
        let fit = (room(caps) / row).min(all);
        if fit == 0 {
            return Err(KernelError::RowTooLarge { kernel, bytes: row * 4, limit: caps.max_binding });
        }
        // A row of tau is longer than three words, so one time always fits.
        let times = times_of_window(fit, all, caps).clamp(1, all_times);
        let mut out = Vec::new();
        for first in (0..all).step_by(fit as usize) {
            for t0 in (0..all_times).step_by(times as usize) {
                out.push(self.dispatch((first, fit.min(all - first)), (t0, times.min(all_times - t0)), caps));
            }
        }
        Ok(out)
    }

    fn dispatch(&self, (first, n): (u64, u64), (t0, nt): (u64, u64), caps: &Caps) -> Dispatch {
        let (all, all_times) = (u64::from(self.n), u64::from(self.times));
        let (row, state_row) = (all_times * 9 + 1, u64::from(STATE_WORDS));
        let (tau, tau_rest) = cover(TAU, first * row, n * row, caps);
        let (dtau, _) = cover(DTAU, first * row, n * row, caps);
        let (x, x_rest) = cover(POINTS, first * 3, n * 3, caps);
        let (dx, _) = cover(DPOINTS, first * 3, n * 3, caps);
        let (dy, dy_rest) = cover(DY, (t0 * all + first) * 3, ((nt - 1) * all + n) * 3, caps);
        let (dtheta, theta_rest) = cover(DTHETA.when(self.theta), first, n, caps);
        let (state, state_rest) = cover(STATE, first * state_row, n * state_row, caps);
        let (gate, threshold) = self.motion.gate.code();
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        let params = TrajApplyGradParams {
            n: n as u32,
            times: self.times,
            t0: t0 as u32,
            nt: nt as u32,
            step: (all * 3) as u32,
            relative: u32::from(self.motion.relative),
            gate,
            threshold,
            min_norm: self.motion.min_norm,
            tau_rest,
            x_rest,
            dy_rest,
            theta_rest,
            state_rest,
            flags: set(self.theta, HAS_THETA) | set(t0 > 0, GO_ON) | set(t0 + nt == all_times, LAST),
            pad0: 0,
        };
        Dispatch::new(&shaders::BASELINE, &params, &[tau, x, WHEN.into(), dy, dtheta, dtau, dx, state], n.div_ceil(64))
    }
}
