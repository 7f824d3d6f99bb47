//! Cases of `deform_sample_grad_field`.

use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::deform_sample_grad_field::{DFIELD, DMASK, DeformSampleGradField};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::deform_sample::{Inputs, NETWORKS, name, release, spec};
use super::deform_sample_grad::dtau;
use super::{Call, Case, Values, Work};

/// All arguments with these inputs.
#[must_use]
pub fn args(spec: &DeformSample, inputs: &Inputs) -> Vec<Values> {
    // Field and mask are not read.
    let mut args = inputs.args(spec);
    args.truncate(3);
    let scratch = DeformSampleGradField(*spec).scratch();
    let outputs = [spec.field_words(), spec.cells(), scratch].map(|words| Values::Out(words as usize));
    args.push(Values::F32(dtau(spec)));
    args.extend(outputs);
    args
}

impl Call for DeformSampleGradField {
    fn kernel(&self) -> &'static str {
        "deform_sample_grad_field"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        args(&self.0, &Inputs::new(&self.0))
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let inputs = Inputs::new(&self.0);
        let (dfield, dmask) = cpu::deform_sample_grad_field(&self.0, &inputs.sampled(), args[3].f32());
        vec![(DFIELD, Values::F32(dfield)), (DMASK, Values::F32(dmask))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        5e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// One pixel and one cell; one row, one column; a list; more columns than a workgroup; several parts, the last one short; the
/// release's points; then whole images.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [
        spec([1, 1], [1, 1], 1, None),
        spec([33, 1], [7, 1], 2, None),
        spec([1, 17], [1, 4], 1, None),
        spec([33, 14], [4, 2], 9, None),
        spec([28, 14], [2, 1], 1, Some(1)),
        spec([33, 28], [6, 5], 3, Some(1131)),
        spec([70, 50], [5, 4], 2, None),
        release([20, 9], [5, 3], 3),
    ];
    let benches = NETWORKS.map(|spec| Case::bench(name(&spec), DeformSampleGradField(spec)));
    tests.map(|spec| Case::test(DeformSampleGradField(spec))).into_iter().chain(benches).collect()
}
