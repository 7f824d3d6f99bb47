//! Oracle of `trajectory`.

use crate::cpu::deform_sample::{Sampled, deform_sample};
use crate::cpu::traj_apply::traj_apply;
use crate::traj_apply::TrajApply;
use crate::trajectory::Trajectory;

/// Points `[nt, n, 3]` at the times from `t0`, and scores `[n]`: the two oracles one after the other.
#[must_use]
pub fn trajectory(
    spec: &Trajectory,
    data: &Sampled<'_>,
    points: &[f32],
    (own, t0): (usize, usize),
) -> (Vec<f32>, Vec<f32>) {
    let tau = deform_sample(&spec.sample, data);
    let apply = TrajApply { n: spec.sample.n, times: spec.sample.times, motion: spec.motion };
    let (y, theta) = traj_apply(&apply, &tau, points, own);
    let row = spec.sample.n as usize * 3;
    (y[t0 * row..(t0 + spec.nt as usize) * row].to_vec(), theta)
}
