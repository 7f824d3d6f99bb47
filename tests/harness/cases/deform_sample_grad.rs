//! Cases of `deform_sample_grad`.

use omnix_kernels::deform_sample_grad::{DOFFSETS, DWEIGHTS, DeformSampleGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::deform_sample::{Inputs, NETWORKS, name, release, spec};
use super::{Call, Case, Values, Work};
use crate::Rng;

/// Seeded gradient of what is sampled, `[n, 9 T + 1]`.
#[must_use]
pub fn dtau(spec: &omnix_kernels::deform_sample::DeformSample) -> Vec<f32> {
    Rng::new(u64::from(spec.n + 11)).normal((spec.n * (spec.times * 9 + 1)) as usize)
}

impl Call for DeformSampleGrad {
    fn kernel(&self) -> &'static str {
        "deform_sample_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let taps = self.0.n as usize * self.0.taps() as usize;
        let mut args = Inputs::new(&self.0).args(&self.0);
        args.extend([Values::F32(dtau(&self.0)), Values::Out(taps * 2), Values::Out(taps)]);
        args
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let inputs = Inputs::new(&self.0);
        let grad = cpu::deform_sample_grad(&self.0, &inputs.sampled(), args[5].f32());
        vec![(DOFFSETS, Values::F32(grad.offsets)), (DWEIGHTS, Values::F32(grad.weights))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        5e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// One pixel and one cell; one row, one column; a list, longer than a workgroup; the release's points; then whole images.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [
        spec([1, 1], [1, 1], 1, None),
        spec([33, 1], [7, 1], 2, None),
        spec([1, 17], [1, 4], 1, None),
        spec([33, 14], [4, 2], 5, None),
        spec([28, 14], [2, 1], 1, Some(1)),
        spec([33, 28], [6, 5], 3, Some(131)),
        release([20, 9], [5, 3], 3),
    ];
    let benches = NETWORKS.map(|spec| Case::bench(name(&spec), DeformSampleGrad(spec)));
    tests.map(|spec| Case::test(DeformSampleGrad(spec))).into_iter().chain(benches).collect()
}
