//! Gradients of functions of one value or of two, element by element, and of a choice between two.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Binary, Graph, Map, Operand, ReduceOp, Select, Unary, Zip};

/// `dx = dy · op'(x)`.
impl Rule for Map {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (y, Some(dy)) = node.first() else { return Ok(()) };
        let dx = match self.op {
            Unary::Neg => graph.map(Unary::Neg, dy),
            Unary::ScaleShift { s, .. } => graph.map(Unary::ScaleShift { s, t: 0.0 }, dy),
            // Its own result is the derivative.
            Unary::Exp => graph.zip(Binary::Mul, dy, y)?,
            op => graph.map_grad(op, self.x, dy)?,
        };
        gradients.add(graph, self.x, dx)
    }

    /// Signs and comparisons change in steps.
    fn passes_to(&self, _: Value) -> bool {
        !matches!(self.op, Unary::Sign | Unary::IsFinite | Unary::Below { .. })
    }
}

impl Rule for Zip {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (y, Some(dy)) = node.first() else { return Ok(()) };
        let Self { op, a, b } = *self;
        if gradients.wants(a) {
            let da = match op {
                Binary::Add | Binary::Sub => Some(dy),
                Binary::Mul => Some(graph.zip_operand(Binary::Mul, dy, b)),
                Binary::Div => Some(graph.zip_operand(Binary::Div, dy, b)),
                Binary::Keep | Binary::Drop => Some(graph.zip_operand(op, dy, b)),
                // Where both are equal, the gradient of a maximum goes to a, that of a minimum to b.
                Binary::Max => Some(graph.masked(Binary::Drop, dy, (a, b))?),
                Binary::Min => Some(graph.masked(Binary::Keep, dy, (a, b))?),
                Binary::Equal | Binary::Less => None,
            };
            if let Some(da) = da {
                gradients.add(graph, a, da)?;
            }
        }
        if gradients.wants(b.value) {
            let full = match op {
                Binary::Add => Some(dy),
                Binary::Sub => Some(graph.map(Unary::Neg, dy)),
                Binary::Mul => Some(graph.zip(Binary::Mul, dy, a)?),
                Binary::Div => {
                    let product = graph.zip(Binary::Mul, dy, y)?;
                    let negative = graph.map(Unary::Neg, product);
                    Some(graph.zip_operand(Binary::Div, negative, b))
                }
                Binary::Max => Some(graph.masked(Binary::Keep, dy, (a, b))?),
                Binary::Min => Some(graph.masked(Binary::Drop, dy, (a, b))?),
                Binary::Equal | Binary::Less | Binary::Keep | Binary::Drop => None,
            };
            if let Some(full) = full {
                let db = sum_to_operand(graph, full, b)?;
                gradients.add(graph, b.value, db)?;
            }
        }
        Ok(())
    }

    fn passes_to(&self, input: Value) -> bool {
        match self.op {
            Binary::Equal | Binary::Less => false,
            Binary::Keep | Binary::Drop => input == self.a,
            _ => true,
        }
    }
}

/// Each gets the gradient where it was chosen.
impl Rule for Select {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        for (value, op) in [(self.a, Binary::Keep), (self.b, Binary::Drop)] {
            if gradients.wants(value) {
                let part = graph.zip_operand(op, dy, self.mask);
                gradients.add(graph, value, part)?;
            }
        }
        Ok(())
    }

    fn passes_to(&self, input: Value) -> bool {
        input == self.a || input == self.b
    }
}

impl Graph {
    /// What of `x` belongs to elements with a < b (`Binary::Keep`), or to the others (`Binary::Drop`); 0 elsewhere.
    fn masked(&mut self, op: Binary, x: Value, (a, b): (Value, Operand)) -> Result<Value, GraphError> {
        let less = self.zip_operand(Binary::Less, a, b);
        self.zip(op, x, less)
    }
}

/// The sum of what shares an element of the operand `b`: from the shape of the first operand to that of `b`.
fn sum_to_operand(graph: &mut Graph, full: Value, b: Operand) -> Result<Value, GraphError> {
    let elements = graph.shape(full).elements();
    let outer = elements / (b.div * b.len).max(1);
    let mut sum = graph.reshape(full, [outer, b.len, b.div])?;
    if b.div > 1 {
        sum = graph.reduce(sum, ReduceOp::Sum, 2)?;
    }
    if outer > 1 {
        sum = graph.reduce(sum, ReduceOp::Sum, 0)?;
    }
    graph.reshape(sum, graph.shape(b.value).clone())
}
