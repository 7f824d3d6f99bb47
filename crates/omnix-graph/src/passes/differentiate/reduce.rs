//! Gradients of sums, means, standard deviations and extremes over one axis.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Binary, Graph, Reduce, ReduceOp, Unary};

impl Rule for Reduce {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (y, Some(dy)) = node.first() else { return Ok(()) };
        let n = self.dims[1] as f32;
        let dx = match self.op {
            ReduceOp::Sum => self.spread(graph, dy)?,
            ReduceOp::Mean => {
                let share = graph.map(Unary::ScaleShift { s: 1.0 / n, t: 0.0 }, dy);
                self.spread(graph, share)?
            }
            // (x − mean) / ((n − 1) · std); 0 where nothing deviates.
            ReduceOp::Std => {
                let x = graph.reshape(self.x, self.dims)?;
                let mean = graph.reduce(x, ReduceOp::Mean, 1)?;
                let mean = self.spread(graph, mean)?;
                let off = graph.zip(Binary::Sub, x, mean)?;
                let scaled = graph.map(Unary::ScaleShift { s: (n - 1.0).max(1.0), t: 0.0 }, y);
                let slope = graph.zip(Binary::Div, dy, scaled)?;
                let slope = graph.zip(Binary::Keep, slope, y)?;
                let slope = self.spread(graph, slope)?;
                graph.zip(Binary::Mul, slope, off)?
            }
            // Shared by all that are the extreme.
            ReduceOp::Max | ReduceOp::Min => {
                let x = graph.reshape(self.x, self.dims)?;
                let extreme = self.spread(graph, y)?;
                let mask = graph.zip(Binary::Equal, x, extreme)?;
                let count = graph.reduce(mask, ReduceOp::Sum, 1)?;
                let dy = graph.reshape(dy, graph.shape(count).clone())?;
                let share = graph.zip(Binary::Div, dy, count)?;
                let share = self.spread(graph, share)?;
                graph.zip(Binary::Keep, share, mask)?
            }
        };
        gradients.add(graph, self.x, dx)
    }
}

impl Reduce {
    /// A number of the result for each of the numbers it is made of: `[outer, n, inner]`.
    fn spread(&self, graph: &mut Graph, of: Value) -> Result<Value, GraphError> {
        graph.broadcast_middle(of, self.dims)
    }
}
