//! Cases of `traj_apply_grad`.

use omnix_kernels::traj_apply::{Gate, Motion, TrajApply};
use omnix_kernels::traj_apply_grad::{DPOINTS, DTAU, STATE_WORDS, TrajApplyGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::traj_apply::{inputs, motions};
use super::{Call, Case, Values, Work};
use crate::Rng;

/// As training moves points.
pub const TRAINING: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.5) };

/// A call for points that were seen at a time.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The specification.
    pub spec: TrajApplyGrad,
    /// The own time.
    pub own: u32,
    /// In place of numbers near the identity.
    pub tau: Option<Vec<f32>>,
}

impl Call for Seen {
    fn kernel(&self) -> &'static str {
        "traj_apply_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let TrajApplyGrad { n, times, motion, theta } = self.spec;
        let (tau, points) = inputs(&TrajApply { n, times, motion });
        let tau = self.tau.clone().unwrap_or(tau);
        let (n, times) = (n as usize, times as usize);
        let mut rng = Rng::new(7 + n as u64);
        let dy = rng.normal(times * n * 3);
        let dtheta = if theta { Values::F32(rng.normal(n)) } else { Values::Out(1) };
        let outputs = [tau.len(), n * 3, n * STATE_WORDS as usize].map(Values::Out);
        let when = Values::U32(vec![self.own]);
        [Values::F32(tau), Values::F32(points), when, Values::F32(dy), dtheta].into_iter().chain(outputs).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let inputs = [0, 1, 3, 4].map(|i| args[i].f32());
        let (dtau, dpoints) = cpu::traj_apply_grad(&self.spec, inputs, self.own as usize);
        vec![(DTAU, Values::F32(dtau)), (DPOINTS, Values::F32(dpoints))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        4e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// Every switch over one, odd, above a workgroup; then the pixels of one image.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for motion in motions() {
        for (n, times, own, theta) in [(1, 1, 0, true), (7, 3, 2, false), (65, 4, 1, true), (300, 2, 0, false)] {
            cases.push(Case::test(Seen { spec: TrajApplyGrad { n, times, motion, theta }, own, tau: None }));
        }
    }
    for (n, times) in [(504 * 280, 16), (140 * 84, 16)] {
        let spec = TrajApplyGrad { n, times, motion: TRAINING, theta: true };
        cases.push(Case::bench(format!("{n} pixels, {times} times"), Seen { spec, own: 0, tau: None }));
    }
    cases
}
