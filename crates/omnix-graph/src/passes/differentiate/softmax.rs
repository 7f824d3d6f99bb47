//! The gradient of softmax: `dx = y · (dy − Σ y · dy)`, the sum over the row.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::ops::{Binary, Graph, ReduceOp, Softmax};

impl Rule for Softmax {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (y, Some(dy)) = node.first() else { return Ok(()) };
        let weighted = graph.zip(Binary::Mul, y, dy)?;
        let last = graph.shape(weighted).len().saturating_sub(1);
        let sums = graph.reduce(weighted, ReduceOp::Sum, last)?;
        let centred = graph.zip_rows(Binary::Sub, dy, sums)?;
        let dx = graph.zip(Binary::Mul, centred, y)?;
        gradients.add(graph, self.x, dx)
    }
}
