//! Field and mask of an image at its pixels' sampling points.

use omnix_kernels::KernelError;

use super::sampling::Sampling;
use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// A field and a mask at sampling points.
#[derive(Clone, Debug)]
pub struct DeformSample(pub Sampling);

impl<O: Operation + From<DeformSample>> Graph<O> {
    /// The field and the mask of an image at its pixels' sampling points: `[n, 9 T + 1]`, times then the score.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn deform_sample(&mut self, sampling: &Sampling) -> Result<Value, GraphError> {
        let (n, times) = sampling.check(self, "deform_sample")?;
        Ok(self.push_one(DeformSample(*sampling), [n, times * 9 + 1]))
    }
}

impl Operation for DeformSample {
    fn name(&self) -> &'static str {
        "deform_sample"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.0.map_inputs(map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let args = self.0.args().into_iter().chain([Some(site.outputs[0])]);
        site.call(args, self.0.spec(site.values)?.record(site.caps)?)
    }

    /// Four cells of nine channels per point, weight and time.
    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        8 * values.shape(self.0.weights).elements() as u64 * values.shape(outputs[0]).width() as u64
    }
}
