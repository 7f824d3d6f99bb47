//! `y[t, i] = gate(theta[i], x[i], R'(t) x[i] + b'(t))`: the points of one source image at all target times, from the nine
//! numbers per pixel and time that [`crate::deform_sample`] makes (OmniX spec, section 8.3). The first six become a rotation
//! by Gram-Schmidt with a floor under the norms (below it, not a rotation: computed as written), the last three shift;
//! both relative to the image's own time, or not.

use omnix_shaders::traj_apply as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError};

/// `[n, 9 T + 1]`: six of rotation and three of translation per time, then the motion score.
pub const TAU: Arg = Arg(0);
/// World points `[n, 3]`.
pub const POINTS: Arg = Arg(1);
/// u32 `[1]` or longer: the image's own time is the first (times past the end count as the last).
pub const WHEN: Arg = Arg(2);
/// Output `[T, n, 3]`.
pub const Y: Arg = Arg(3);
/// Output `[n]`: the motion score θ.
pub const THETA: Arg = Arg(4);

/// What the motion score decides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Gate {
    /// Nothing: every point moves.
    #[default]
    None,
    /// Points whose score is above the threshold move, the others stand still.
    Hard(f32),
    /// The score multiplies the displacement.
    Blend,
}

impl Gate {
    /// The number the shaders know it by, and the threshold.
    pub(crate) const fn code(self) -> (u32, f32) {
        match self {
            Self::None => (0, 0.0),
            Self::Hard(threshold) => (1, threshold),
            Self::Blend => (2, 0.0),
        }
    }
}

/// How nine numbers move a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Whether motion is relative to the image's own time.
    pub relative: bool,
    /// The floor under the norms of the 6D rotation.
    pub min_norm: f32,
    /// What the score decides.
    pub gate: Gate,
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajApply {
    /// Points.
    pub n: u32,
    /// Target times, T.
    pub times: u32,
    /// How points move.
    pub motion: Motion,
}

crate::layout::params! {
    /// `Params` of `shaders/traj_apply`.
    pub struct TrajApplyParams {
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
        y_rest: u32,
        theta_rest: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

/// How many times a dispatch over `n` of `all` pixels may write into one window of `[T, all, 3]`; 0 when not even one.
pub(crate) fn times_of_window(n: u64, all: u64, caps: &Caps) -> u64 {
    let fit = room(caps) / 3;
    if n > fit { 0 } else { (fit - n) / all + 1 }
}

impl TrajApply {
    /// Bytes read and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.n as u64 * (12 * self.times as u64 + 5)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or a row of tau is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "traj_apply";
        if self.n == 0 || self.times == 0 {
            let reason = format!("{} points at {} times; none may be 0", self.n, self.times);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let (all, all_times) = (u64::from(self.n), u64::from(self.times));
        let row = all_times * 9 + 1;
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
        let (all, row) = (u64::from(self.n), u64::from(self.times) * 9 + 1);
        let (tau, tau_rest) = cover(TAU, first * row, n * row, caps);
        let (x, x_rest) = cover(POINTS, first * 3, n * 3, caps);
        let (y, y_rest) = cover(Y, (t0 * all + first) * 3, ((nt - 1) * all + n) * 3, caps);
        let (theta, theta_rest) = cover(THETA, first, n, caps);
        let (gate, threshold) = self.motion.gate.code();
        let params = TrajApplyParams {
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
            y_rest,
            theta_rest,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        Dispatch::new(&shaders::BASELINE, &params, &[tau, x, WHEN.into(), y, theta], n.div_ceil(64))
    }
}
