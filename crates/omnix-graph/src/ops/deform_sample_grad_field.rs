//! The gradient of [`super::DeformSample`] with respect to field and mask.

use omnix_kernels::{KernelError, deform_sample_grad_field};

use super::sampling::Sampling;
use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The gradient of what pixels sample.
#[derive(Clone, Debug)]
pub struct DeformSampleGradField {
    /// What was sampled, and where; field and mask are known by their shapes alone.
    pub sampling: Sampling,
    /// Gradient of the result, `[n, 9 T + 1]`.
    pub dtau: Value,
}

impl<O: Operation + From<DeformSampleGradField>> Graph<O> {
    /// The gradients of the field and the mask of [`Graph::deform_sample`], in their shapes.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn deform_sample_grad_field(&mut self, sampling: &Sampling, dtau: Value) -> Result<(Value, Value), GraphError> {
        let op = "deform_sample_grad_field";
        let (n, times) = sampling.check(self, op)?;
        self.expect(op, dtau, &[n, times * 9 + 1])?;
        let scratch = deform_sample_grad_field::DeformSampleGradField(sampling.spec(self)?).scratch();
        let [field, mask] = [sampling.field, sampling.mask].map(|value| self.shape(value).clone());
        let shapes = [field, mask, Shape::from([scratch as usize])];
        let outputs = self.push(DeformSampleGradField { sampling: *sampling, dtau }, shapes);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for DeformSampleGradField {
    fn name(&self) -> &'static str {
        "deform_sample_grad_field"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.sampling.map_inputs(map);
        self.dtau = map(self.dtau);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = deform_sample_grad_field::DeformSampleGradField(self.sampling.spec(site.values)?);
        let Sampling { offsets, weights, pixels, .. } = self.sampling;
        let inputs = [Some(offsets), Some(weights), pixels, Some(self.dtau)];
        let args = inputs.into_iter().chain(site.outputs.iter().copied().map(Some));
        site.call(args, spec.record(site.caps)?)
    }

    /// Four cells of nine channels per point and time.
    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        8 * values.shape(self.sampling.weights).elements() as u64 * values.shape(self.dtau).width() as u64
    }
}
