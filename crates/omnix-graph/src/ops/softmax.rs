//! Softmax over the last axis.

use omnix_kernels::{KernelError, softmax};

use crate::graph::{Call, Graph, Operation, RowWise, Site, Value, Values};

/// Softmax of rows.
#[derive(Clone, Debug)]
pub struct Softmax {
    /// `[.., n]`.
    pub x: Value,
}

impl<O: Operation + From<Softmax>> Graph<O> {
    /// Softmax over the last axis.
    pub fn softmax(&mut self, x: Value) -> Value {
        let shape = self.shape(x).clone();
        self.push_one(Softmax { x }, shape)
    }
}

impl Operation for Softmax {
    fn name(&self) -> &'static str {
        "softmax"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = softmax::Softmax { m: site.rows(self.x)?, n: site.width(self.x)? };
        site.call([Some(self.x), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        6 * values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.x).rows(), 1, 1, 0))
    }
}
