//! Pointwise operations and their broadcasts.

use crate::error::GraphError;
use crate::graph::{Graph, Value};
use crate::op::{Binary, Op, Operand, Unary};

impl Graph {
    /// `op(x)`, element by element.
    pub fn map(&mut self, op: Unary, x: Value) -> Value {
        let shape = self.shape(x).clone();
        self.push_one(Op::Unary { op, x }, shape)
    }

    /// `op(a, b)`; `b` has `a`'s shape, or a suffix of it (a row `[c]` under `[.., c]`, a table `[t, c]` under `[s, t, c]`),
    /// or is one number.
    ///
    /// # Errors
    /// When `b`'s shape is no suffix of `a`'s.
    pub fn zip(&mut self, op: Binary, a: Value, b: Value) -> Result<Value, GraphError> {
        let (left, right) = (self.shape(a), self.shape(b));
        if !left.ends_with(right) && right.elements() != 1 {
            return Err(self.misfit("pointwise", b, format!("a suffix of {left}")));
        }
        let (shape, len) = (left.clone(), right.elements());
        Ok(self.push_one(Op::Binary { op, a, b: Operand { value: b, div: 1, len } }, shape))
    }

    /// `op(a[r, ..], b[r])`: one number a row; `b` has as many elements as `a` has rows of its last axis.
    ///
    /// # Errors
    /// When it has not.
    pub fn zip_rows(&mut self, op: Binary, a: Value, b: Value) -> Result<Value, GraphError> {
        let shape = self.shape(a).clone();
        if self.shape(b).elements() != shape.rows() {
            return Err(self.misfit("pointwise", b, format!("one number for each of {} rows", shape.rows())));
        }
        let b = Operand { value: b, div: shape.width(), len: shape.rows() };
        Ok(self.push_one(Op::Binary { op, a, b }, shape))
    }

    /// `a + b` as [`Graph::zip`].
    ///
    /// # Errors
    /// As [`Graph::zip`].
    pub fn add_values(&mut self, a: Value, b: Value) -> Result<Value, GraphError> {
        self.zip(Binary::Add, a, b)
    }
}
