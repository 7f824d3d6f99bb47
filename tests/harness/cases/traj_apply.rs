//! Cases of `traj_apply`.

use omnix_kernels::traj_apply::{Gate, Motion, THETA, TrajApply, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// As the release moves points.
pub const RELEASE: Motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };

/// Every combination of the switches.
#[must_use]
pub fn motions() -> Vec<Motion> {
    let gates = [Gate::None, Gate::Hard(0.3), Gate::Blend];
    [true, false].iter().flat_map(|r| gates.map(|gate| Motion { relative: *r, min_norm: 1e-3, gate })).collect()
}

/// A call for points that were seen at a time.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The specification.
    pub spec: TrajApply,
    /// The own time.
    pub own: u32,
}

/// tau near the identity with scores in 0..1, and points.
#[must_use]
pub fn inputs(spec: &TrajApply) -> (Vec<f32>, Vec<f32>) {
    let (n, row) = (spec.n as usize, spec.times as usize * 9 + 1);
    let mut rng = Rng::new(u64::from(spec.n + spec.times));
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    // The last number of a row is its score, which is drawn below.
    let near = |(i, v): (usize, &f32)| identity[i % row % 9] + 0.4 * v;
    let mut tau: Vec<f32> = rng.normal(n * row).iter().enumerate().map(near).collect();
    tau.iter_mut().skip(row - 1).step_by(row).for_each(|theta| *theta = rng.uniform());
    (tau, rng.normal(n * 3))
}

impl Call for Seen {
    fn kernel(&self) -> &'static str {
        "traj_apply"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let (tau, points) = inputs(&self.spec);
        let n = self.spec.n as usize;
        let outputs = [Values::Out(self.spec.times as usize * n * 3), Values::Out(n)];
        [Values::F32(tau), Values::F32(points), Values::U32(vec![self.own])].into_iter().chain(outputs).collect()
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let (y, theta) = cpu::traj_apply(&self.spec, args[0].f32(), args[1].f32(), self.own as usize);
        vec![(Y, Values::F32(y)), (THETA, Values::F32(theta))]
    }

    fn limit(&self, _: &Caps, arg: Arg) -> f64 {
        if arg == THETA { 0.0 } else { 1e-6 }
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
        for (n, times, own) in [(1, 1, 0), (7, 3, 2), (65, 4, 1), (300, 2, 0)] {
            cases.push(Case::test(Seen { spec: TrajApply { n, times, motion }, own }));
        }
    }
    for (n, times) in [(504 * 280, 16), (140 * 84, 16)] {
        let spec = TrajApply { n, times, motion: RELEASE };
        cases.push(Case::bench(format!("{n} pixels, {times} times"), Seen { spec, own: 0 }));
    }
    cases
}
