//! The gradient of [`super::SwiGlu`]: `[.., 2h]` from what went into it and the gradient of its result `[.., h]`.

use omnix_kernels::{KernelError, swiglu_grad};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, RowWise, Site, Value, Values};

/// The gradient of the gate of a feed-forward layer.
#[derive(Clone, Debug)]
pub struct SwiGluGrad {
    /// What went into it, `[.., 2h]`.
    pub x: Value,
    /// Gradient of its result, `[.., h]`.
    pub dy: Value,
}

impl<O: Operation + From<SwiGluGrad>> Graph<O> {
    /// `[dy · b · silu'(a) | dy · silu(a)]` of `x = [a | b]`.
    ///
    /// # Errors
    /// When the width of `x` is not twice that of `dy`, or their rows differ.
    pub fn swiglu_grad(&mut self, x: Value, dy: Value) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        let half = shape.with_width(shape.width() / 2);
        if !shape.width().is_multiple_of(2) || *self.shape(dy) != half {
            return Err(self.misfit("swiglu_grad", dy, format!("half the width of {shape}")));
        }
        Ok(self.push_one(SwiGluGrad { x, dy }, shape))
    }
}

impl Operation for SwiGluGrad {
    fn name(&self) -> &'static str {
        "swiglu_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.dy], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = swiglu_grad::SwiGluGrad { m: site.rows(self.x)?, h: site.width(self.dy)? };
        site.call([self.x, self.dy, site.outputs[0]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        10 * values.shape(self.dy).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.x).rows(), 1, 2, 0))
    }
}
