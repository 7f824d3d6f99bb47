//! The gradient of a map that was resized: each pixel gets what it gave.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Graph, Resize};

impl Rule for Resize {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let [_, rows, columns, _] = graph.map_dims("resize", self.x)?;
        let dx = graph.resize_grad(dy, [rows, columns], self.filter, self.corners)?;
        gradients.add(graph, self.x, dx)
    }

    /// A code of rows and columns is known.
    fn passes_to(&self, input: Value) -> bool {
        input == self.x
    }
}
