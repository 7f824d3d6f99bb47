//! The gradient of [`super::DeformSample`] with respect to offsets and weights.

use omnix_kernels::{KernelError, deform_sample_grad};

use super::sampling::Sampling;
use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// The gradient of where pixels sample, and by what weight.
#[derive(Clone, Debug)]
pub struct DeformSampleGrad {
    /// What was sampled, and where.
    pub sampling: Sampling,
    /// Gradient of the result, `[n, 9 T + 1]`.
    pub dtau: Value,
}

impl<O: Operation + From<DeformSampleGrad>> Graph<O> {
    /// The gradients of the offsets and weights of [`Graph::deform_sample`], in their shapes.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn deform_sample_grad(&mut self, sampling: &Sampling, dtau: Value) -> Result<(Value, Value), GraphError> {
        let op = "deform_sample_grad";
        let (n, times) = sampling.check(self, op)?;
        self.expect(op, dtau, &[n, times * 9 + 1])?;
        let shapes = [sampling.offsets, sampling.weights].map(|value| self.shape(value).clone());
        let outputs = self.push(DeformSampleGrad { sampling: *sampling, dtau }, shapes);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for DeformSampleGrad {
    fn name(&self) -> &'static str {
        "deform_sample_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.sampling.map_inputs(map);
        self.dtau = map(self.dtau);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = deform_sample_grad::DeformSampleGrad(self.sampling.spec(site.values)?);
        let outputs = [self.dtau, site.outputs[0], site.outputs[1]].map(Some);
        site.call(self.sampling.args().into_iter().chain(outputs), spec.record(site.caps)?)
    }

    /// Four cells of nine channels per point and time.
    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        8 * values.shape(self.sampling.weights).elements() as u64 * values.shape(self.dtau).width() as u64
    }
}
