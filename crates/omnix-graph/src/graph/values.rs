//! The table of a graph's values: shapes, names, and where each comes from. Operations know this table and nothing else of
//! the graph, which is what keeps their shape rules and kernel calls free of it.

use std::sync::Arc;

use omnix_kernels::WeightType;

use super::parameter::Parameter;
use super::value::{Shape, Value};
use crate::error::GraphError;

/// Where a value comes from.
#[derive(Clone, Debug)]
pub enum Source {
    /// Written by the caller before a run.
    Input,
    /// Read from the checkpoint.
    Parameter(Parameter),
    /// Known when the graph is recorded: tables that depend on sizes alone.
    Constant(Arc<[f32]>),
    /// An output of the node with this index.
    Node(usize),
    /// The same numbers as another value under another shape.
    Reshape(Value),
    /// The numbers of `value`; a gradient goes to `gradient` instead, or ends here.
    StraightThrough {
        /// Whose numbers it has.
        value: Value,
        /// What stands for it in a derivative, if anything.
        gradient: Option<Value>,
    },
}

/// What is known about a value.
#[derive(Clone, Debug)]
pub struct ValueInfo {
    /// For messages, plans and traces.
    pub name: String,
    /// Static shape.
    pub shape: Shape,
    /// Where it comes from.
    pub source: Source,
    /// What it takes in memory, where the layout pads: `shape` otherwise.
    pub physical: Shape,
    /// How its numbers are stored, where it is a matrix that a node has packed for products.
    pub stored: WeightType,
}

/// All values of a graph.
#[derive(Clone, Debug, Default)]
pub struct Values {
    infos: Vec<ValueInfo>,
}

impl Values {
    /// What is known about `value`.
    #[must_use]
    pub fn info(&self, value: Value) -> &ValueInfo {
        &self.infos[value.0 as usize]
    }

    /// The shape of `value`.
    #[must_use]
    pub fn shape(&self, value: Value) -> &Shape {
        &self.info(value).shape
    }

    /// The name of `value`.
    #[must_use]
    pub fn value_name(&self, value: Value) -> &str {
        &self.info(value).name
    }

    /// All values, in the order of their handles.
    pub fn values(&self) -> impl Iterator<Item = (Value, &ValueInfo)> {
        self.infos.iter().enumerate().map(|(i, info)| (Value(i as u32), info))
    }

    /// Number of values.
    #[must_use]
    pub fn count(&self) -> usize {
        self.infos.len()
    }

    /// Finds an input or output (or any value) by name; the last one wins.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<Value> {
        self.infos.iter().rposition(|v| v.name == name).map(|i| Value(i as u32))
    }

    /// The value whose memory `value` shares: follows reshapes and straight-through values.
    #[must_use]
    pub fn root(&self, value: Value) -> Value {
        let mut at = value;
        while let Source::Reshape(inner) | Source::StraightThrough { value: inner, .. } = self.info(at).source {
            at = inner;
        }
        at
    }

    pub(crate) fn add(&mut self, name: String, shape: Shape, source: Source) -> Value {
        let physical = shape.clone();
        self.infos.push(ValueInfo { name, shape, source, physical, stored: WeightType::F32 });
        Value((self.infos.len() - 1) as u32)
    }

    pub(crate) fn info_mut(&mut self, value: Value) -> &mut ValueInfo {
        &mut self.infos[value.0 as usize]
    }

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
