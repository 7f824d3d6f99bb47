//! Gradients of the gate of a feed-forward layer, and of dropout.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Dropout, Graph, SwiGlu};

impl Rule for SwiGlu {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let dx = graph.swiglu_grad(self.x, dy)?;
        gradients.add(graph, self.x, dx)
    }
}

/// The same numbers are left out.
impl Rule for Dropout {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let dx = graph.dropout(dy, self.step, self.p, (self.seed, self.stream))?;
        gradients.add(graph, self.x, dx)
    }

    fn passes_to(&self, input: Value) -> bool {
        input == self.x
    }
}
