//! Cases of `trajectory`.

use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::traj_apply::{Gate, Motion};
use omnix_kernels::trajectory::{THETA, Trajectory, Y, packed_words};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::deform_sample::{Inputs, NETWORKS, name, release, spec as sampled};
use super::traj_apply::{RELEASE, motions};
use super::{Call, Case, Values, Work};
use crate::Rng;

/// A call for points that were seen at a time, for times from another on.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The specification.
    pub spec: Trajectory,
    /// The own time, and the first target time.
    pub when: [u32; 2],
}

/// A point for every pixel.
#[must_use]
pub fn points(spec: &DeformSample) -> Vec<f32> {
    Rng::new(u64::from(spec.n)).normal(spec.n as usize * 3)
}

/// The kernel's arguments for inputs of one's own.
#[must_use]
pub fn args(spec: &Trajectory, inputs: &Inputs, when: [u32; 2]) -> Vec<Values> {
    let sample = &spec.sample;
    let n = sample.n as usize;
    let packed = packed_words(u64::from(sample.levels), u64::from(spec.nt), sample.cells());
    let mut args = inputs.args(sample);
    args.extend([
        Values::F32(points(sample)),
        Values::U32(when.to_vec()),
        Values::Out(spec.nt as usize * n * 3),
        Values::Out(n),
        Values::Out(spec.anchor_words() as usize),
        Values::Out(packed as usize),
    ]);
    args
}

impl Call for Seen {
    fn kernel(&self) -> &'static str {
        "trajectory"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        args(&self.spec, &Inputs::new(&self.spec.sample), self.when)
    }

    fn oracle(&self, _: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        let (inputs, x) = (Inputs::new(&self.spec.sample), points(&self.spec.sample));
        let [own, first] = self.when.map(|time| time as usize);
        let (y, theta) = cpu::trajectory(&self.spec, &inputs.sampled(), &x, (own, first));
        vec![(Y, Values::F32(y)), (THETA, Values::F32(theta))]
    }

    fn limit(&self, _: &Caps, arg: Arg) -> f64 {
        if arg == THETA { 1e-6 } else { 1e-5 }
    }

    fn work(&self) -> Work {
        Work::Flops(self.spec.flops())
    }
}

/// What is sampled in tests.
#[must_use]
pub fn samples() -> Vec<DeformSample> {
    vec![
        sampled([1, 1], [1, 1], 1, None),
        sampled([33, 1], [7, 1], 2, None),
        sampled([33, 14], [4, 2], 5, None),
        sampled([33, 28], [6, 5], 3, Some(131)),
        // Two and one times in a window of the software variant; a grid too large for it.
        sampled([33, 14], [30, 15], 5, None),
        sampled([33, 14], [36, 20], 3, None),
        sampled([33, 14], [60, 24], 2, None),
        release([20, 9], [5, 3], 3),
        // More levels than the software variant has windows.
        DeformSample { levels: 6, ..sampled([14, 9], [5, 3], 2, None) },
    ]
}

/// Every way to move without a gate, whose step rounding may cross; then the pixels of one image, straight from the field.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for sample in samples() {
        for motion in motions().into_iter().filter(|motion| motion.gate == Gate::None) {
            let spec = Trajectory { sample, nt: sample.times, motion };
            cases.push(Case::test(Seen { spec, when: [sample.times / 2, 0] }));
        }
    }
    for sample in NETWORKS {
        let motion: Motion = RELEASE;
        let spec = Trajectory { sample, nt: sample.times, motion };
        cases.push(Case::bench(name(&sample), Seen { spec, when: [0, 0] }));
    }
    cases
}
