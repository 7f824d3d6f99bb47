//! The gradient of a layer norm.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::ops::{Graph, LayerNorm};

impl Rule for LayerNorm {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let Self { x, weight, bias, eps, .. } = *self;
        let affine = gradients.wants_some(weight) || gradients.wants_some(bias);
        let (dx, made) = graph.layer_norm_grad(x, weight, dy, eps, affine)?;
        gradients.add(graph, x, dx)?;
        for (value, part) in [weight, bias].into_iter().zip(made.into_iter().flatten()) {
            if let Some(value) = value {
                gradients.add(graph, value, part)?;
            }
        }
        Ok(())
    }
}
