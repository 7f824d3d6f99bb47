//! Gradients of a layer norm over the last axis.

use omnix_kernels::{KernelError, layer_norm_grad};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Gradients of a layer norm's input, weight and bias.
#[derive(Clone, Debug)]
pub struct LayerNormGrad {
    /// The norm's input `[.., c]`.
    pub x: Value,
    /// `[c]`.
    pub weight: Option<Value>,
    /// Gradient of its output, of the input's shape.
    pub dy: Value,
    /// Added to the variance.
    pub eps: f32,
    /// Whether the gradients of weight and bias are wanted.
    pub affine: bool,
}

impl LayerNormGrad {
    fn spec(&self, values: &Values) -> Result<layer_norm_grad::LayerNormGrad, KernelError> {
        let x = values.shape(self.x);
        Ok(layer_norm_grad::LayerNormGrad {
            m: u32_of("layer_norm_grad", x.rows())?,
            c: u32_of("layer_norm_grad", x.width())?,
            eps: self.eps,
            weight: self.weight.is_some(),
            d_weight: self.affine,
            d_bias: self.affine,
        })
    }
}

impl<O: Operation + From<LayerNormGrad>> Graph<O> {
    /// Gradient of `x [.., c]`, and with `affine` those of the weight and of the bias, `[c]` each, from the gradient `dy` of the norm's
    /// output.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn layer_norm_grad(
        &mut self,
        x: Value,
        weight: Option<Value>,
        dy: Value,
        eps: f32,
        affine: bool,
    ) -> Result<(Value, Option<[Value; 2]>), GraphError> {
        let shape = self.shape(x).clone();
        self.expect("layer_norm_grad", dy, &shape)?;
        if let Some(weight) = weight {
            self.expect("layer_norm_grad", weight, &[shape.width()])?;
        }
        let op = LayerNormGrad { x, weight, dy, eps, affine };
        let parts = op.spec(self)?.parts_words();
        let column = || Shape::from([if affine { shape.width() } else { 1 }]);
        // Scratch: statistics of rows, and the sums of sections, at least 1, since a value has memory.
        let scratch = [Shape::from([shape.rows(), 2]), Shape::from([parts.max(1) as usize])];
        let outputs = self.push(op, [shape.clone(), column(), column()].into_iter().chain(scratch));
        Ok((outputs[0], affine.then(|| [outputs[1], outputs[2]])))
    }
}

impl Operation for LayerNormGrad {
    fn name(&self) -> &'static str {
        "layer_norm_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x].into_iter().chain(&mut self.weight).chain([&mut self.dy]), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let outputs = site.outputs.iter().copied().map(Some);
        let args = [Some(self.x), self.weight, Some(self.dy)].into_iter().chain(outputs);
        site.call(args, self.spec(site.values)?.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        16 * values.shape(self.x).elements() as u64
    }
}
