//! How layers record operations: one method an operation, which infers the result's shape or says what does not fit.

mod attend;
mod dense;
mod image;
mod index;
mod layout;
mod motion;
mod pointwise;

pub use attend::{HeadNorm, Heads};
pub use layout::Piece;
pub use motion::Expand;

use crate::error::GraphError;
use crate::graph::{Graph, Value};

impl Graph {
    /// The error that `value` does not have the shape `op` needs.
    pub(crate) fn misfit(&self, op: &'static str, value: Value, expected: impl Into<String>) -> GraphError {
        let info = self.info(value);
        GraphError::Shape { op, value: info.name.clone(), expected: expected.into(), got: info.shape.clone() }
    }

    /// Checks that `value` is exactly `dims`.
    pub(crate) fn expect(&self, op: &'static str, value: Value, dims: &[usize]) -> Result<(), GraphError> {
        if **self.shape(value) == *dims { Ok(()) } else { Err(self.misfit(op, value, format!("{dims:?}"))) }
    }

    /// The dimensions of a map `[frame, row, column, channel]`.
    pub(crate) fn map_dims(&self, op: &'static str, value: Value) -> Result<[usize; 4], GraphError> {
        <[usize; 4]>::try_from(&**self.shape(value))
            .map_err(|_| self.misfit(op, value, "[frames, rows, columns, channels]"))
    }
}
