//! `y = act((x - mean) / sqrt(var + eps) · weight + bias)` over the last axis.

use omnix_kernels::{Activation, KernelError, layer_norm};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, RowWise, Site, Value, Values};

/// Layer norm of rows.
#[derive(Clone, Debug)]
pub struct LayerNorm {
    /// `[.., c]`.
    pub x: Value,
    /// `[c]`.
    pub weight: Option<Value>,
    /// `[c]`.
    pub bias: Option<Value>,
    /// Added to the variance.
    pub eps: f32,
    /// Fused activation.
    pub act: Activation,
}

impl<O: Operation + From<LayerNorm>> Graph<O> {
    /// Layer norm over the last axis; `weight` and `bias` `[c]`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn layer_norm(
        &mut self,
        x: Value,
        weight: Option<Value>,
        bias: Option<Value>,
        eps: f32,
    ) -> Result<Value, GraphError> {
        let c = self.shape(x).width();
        for value in weight.into_iter().chain(bias) {
            self.expect("layer_norm", value, &[c])?;
        }
        let shape = self.shape(x).clone();
        Ok(self.push_one(LayerNorm { x, weight, bias, eps, act: Activation::None }, shape))
    }
}

impl Operation for LayerNorm {
    fn name(&self) -> &'static str {
        "layer_norm"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x].into_iter().chain(&mut self.weight).chain(&mut self.bias), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { x, weight, bias, eps, act } = *self;
        let (m, c) = (site.rows(x)?, site.width(x)?);
        let spec = layer_norm::LayerNorm { m, c, eps, act, weight: weight.is_some(), bias: bias.is_some() };
        site.call([Some(x), weight, bias, Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        6 * values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        let whole = usize::from(self.weight.is_some()) + usize::from(self.bias.is_some());
        Some(RowWise::new(values.shape(self.x).rows(), 1, 1, whole))
    }
}
