//! Gradients of rows by index, read or written. Each row is named at most once, as by a permutation or a choice.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Gather, Graph, Scatter};

/// `dx[index[r]] = dy[r]`, 0 elsewhere.
impl Rule for Gather {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let zeros = graph.fill(graph.shape(self.x).clone(), 0.0);
        let dx = graph.scatter(zeros, dy, self.index)?;
        gradients.add(graph, self.x, dx)
    }

    fn passes_to(&self, input: Value) -> bool {
        input != self.index
    }
}

/// `dx[r] = dy[index[r]]`; the base gets the gradients of the other rows.
impl Rule for Scatter {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        if gradients.wants(self.x) {
            let dx = graph.gather(dy, self.index)?;
            gradients.add(graph, self.x, dx)?;
        }
        if gradients.wants(self.base) {
            let zeros = graph.fill(graph.shape(self.x).clone(), 0.0);
            let rest = graph.scatter(dy, zeros, self.index)?;
            gradients.add(graph, self.base, rest)?;
        }
        Ok(())
    }

    fn passes_to(&self, input: Value) -> bool {
        input != self.index
    }
}
