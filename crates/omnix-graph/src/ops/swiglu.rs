//! `silu(a) · b` of `x = [a | b]`: `[.., 2h]` to `[.., h]`.

use omnix_kernels::{KernelError, swiglu};

use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, RowWise, Site, Value, Values};

/// The gate of a feed-forward layer.
#[derive(Clone, Debug)]
pub struct SwiGlu {
    /// `[.., 2h]`.
    pub x: Value,
}

impl<O: Operation + From<SwiGlu>> Graph<O> {
    /// `silu(a) · b` of `x = [a | b]`: `[.., 2h]` to `[.., h]`.
    ///
    /// # Errors
    /// When the width is odd.
    pub fn swiglu(&mut self, x: Value) -> Result<Value, GraphError> {
        let width = self.shape(x).width();
        if !width.is_multiple_of(2) {
            return Err(self.misfit("swiglu", x, "[.., an even width]"));
        }
        let shape = self.shape(x).with_width(width / 2);
        Ok(self.push_one(SwiGlu { x }, shape))
    }
}

impl Operation for SwiGlu {
    fn name(&self) -> &'static str {
        "swiglu"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = swiglu::SwiGlu { m: site.rows(self.x)?, h: site.n(site.values.shape(self.x).width() / 2)? };
        site.call([Some(self.x), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        4 * values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.x).rows(), 1, 1, 0))
    }
}
