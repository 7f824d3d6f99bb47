//! A recorded computation: values, and nodes that make them, each an operation of a set that this file does not know.

pub mod operation;
pub mod parameter;
pub mod rows;
pub mod storage;
pub mod value;
pub mod values;

use std::ops::{Deref, DerefMut, Range};

use smallvec::SmallVec;

pub use operation::{Call, Operation, Site};
pub use parameter::Parameter;
pub use rows::{Access, RowWise};
pub use storage::{Packing, WeightForm, WeightKey};
pub use value::{Shape, Value};
pub use values::{Source, ValueInfo, Values};

use crate::error::GraphError;

/// One operation and what it makes.
#[derive(Clone, Debug)]
pub struct Node<O> {
    /// The operation with its arguments.
    pub op: O,
    /// Its results; some operations have several.
    pub outputs: SmallVec<[Value; 3]>,
}

/// A recorded computation. Nodes are in an order in which they can run. `O` is the set of operations; a file of an
/// operation needs no more of it than that it takes this operation, so none knows the set or the others.
#[derive(Clone, Debug)]
pub struct Graph<O> {
    pub(crate) values: Values,
    pub(crate) nodes: Vec<Node<O>>,
    pub(crate) outputs: Vec<Value>,
    /// Handles of the values that differentiation recorded: the first of their nodes is where the backward pass begins.
    pub(crate) derived: Range<u32>,
    taps: Vec<String>,
}

impl<O> Default for Graph<O> {
    fn default() -> Self {
        let (nodes, outputs, taps) = (Vec::new(), Vec::new(), Vec::new());
        Self { values: Values::default(), nodes, outputs, derived: 0..0, taps }
    }
}

/// Shapes, names and sources of its values.
impl<O> Deref for Graph<O> {
    type Target = Values;

    fn deref(&self) -> &Values {
        &self.values
    }
}

impl<O> DerefMut for Graph<O> {
    fn deref_mut(&mut self) -> &mut Values {
        &mut self.values
    }
}

impl<O> Graph<O> {
    /// An empty graph.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty graph that keeps every value later named with one of `taps` as an output: how tests look inside.
    #[must_use]
    pub fn with_taps(taps: impl IntoIterator<Item = String>) -> Self {
        Self { taps: taps.into_iter().collect(), ..Self::default() }
    }

    /// The nodes in order.
    #[must_use]
    pub fn nodes(&self) -> &[Node<O>] {
        &self.nodes
    }

    /// The outputs in the order they were declared.
    #[must_use]
    pub fn outputs(&self) -> &[Value] {
        &self.outputs
    }

    /// Names `value`; if the name is one of the taps it becomes an output.
    pub fn name(&mut self, value: Value, name: &str) -> Value {
        name.clone_into(&mut self.info_mut(value).name);
        if self.taps.iter().any(|t| t == name) {
            self.output(value, name);
        }
        value
    }

    /// Keeps `value` under `name` after the run.
    pub fn output(&mut self, value: Value, name: &str) {
        name.clone_into(&mut self.info_mut(value).name);
        if !self.outputs.contains(&value) {
            self.outputs.push(value);
        }
    }

    /// A tensor that the caller writes before a run.
    pub fn input(&mut self, name: &str, shape: impl Into<Shape>) -> Value {
        self.add(name.to_owned(), shape.into(), Source::Input)
    }

    /// A tensor of the checkpoint.
    pub fn parameter(&mut self, name: &str, shape: impl Into<Shape>) -> Value {
        let full = shape.into();
        let rows = 0..full.first().copied().unwrap_or(1);
        self.add_parameter(Parameter { name: name.into(), full, rows, columns: None, keep_f32: false })
    }

    /// Some leading rows of a tensor of the checkpoint, such as the q part of a qkv matrix.
    pub fn parameter_rows(&mut self, name: &str, full: impl Into<Shape>, rows: Range<usize>) -> Value {
        self.add_parameter(Parameter { name: name.into(), full: full.into(), rows, columns: None, keep_f32: false })
    }

    /// Some columns of a matrix `[n, k]` of the checkpoint. A linear layer over inputs side by side is a sum of layers
    /// over each of them, so the inputs need not be put side by side.
    pub fn parameter_columns(&mut self, name: &str, [n, k]: [usize; 2], columns: Range<usize>) -> Value {
        let full = Shape::from([n, k]);
        self.add_parameter(Parameter { name: name.into(), full, rows: 0..n, columns: Some(columns), keep_f32: false })
    }

    /// Stores a parameter as f32 whatever the plan stores: for the few matrices on whose accuracy everything else
    /// depends.
    pub fn keep_f32(&mut self, value: Value) {
        if let Source::Parameter(parameter) = &mut self.info_mut(value).source {
            parameter.keep_f32 = true;
        }
    }

    fn add_parameter(&mut self, parameter: Parameter) -> Value {
        let known = self.values.values().find(|(_, v)| matches!(&v.source, Source::Parameter(p) if *p == parameter));
        if let Some((value, _)) = known {
            return value;
        }
        let name = parameter.name.to_string();
        self.add(name, parameter.shape(), Source::Parameter(parameter))
    }

    /// Makes an input the value that it stands for: how graphs that were recorded apart become one. `value` has the input's elements, and
    /// was there before it.
    ///
    /// # Errors
    /// When it has not, it was not, or `input` is no input.
    pub fn connect(&mut self, input: Value, value: Value) -> Result<(), GraphError> {
        if !matches!(self.info(input).source, Source::Input) {
            return Err(self.misfit("connect", input, "an input"));
        }
        // A gradient goes through values from the last to the first.
        if value >= input {
            return Err(self.misfit("connect", value, "a value that was there before the input"));
        }
        if self.shape(input).elements() != self.shape(value).elements() {
            return Err(self.misfit("connect", value, format!("the elements of {}", self.shape(input))));
        }
        self.info_mut(input).source = Source::Reshape(value);
        Ok(())
    }

    /// Declares no outputs any longer.
    pub fn forget_outputs(&mut self) {
        self.outputs.clear();
    }

    /// Makes a constant an input of the same name: what changes from run to run after all.
    pub fn free_constant(&mut self, value: Value) {
        let info = self.info_mut(value);
        if matches!(info.source, Source::Constant(_)) {
            info.source = Source::Input;
        }
    }

    /// A table known at recording time.
    ///
    /// # Panics
    /// If `data` does not have the shape's number of elements (our own mistake).
    pub fn constant(&mut self, name: &str, shape: impl Into<Shape>, data: Vec<f32>) -> Value {
        let shape = shape.into();
        assert_eq!(shape.elements(), data.len(), "BUG: constant {name}");
        self.add(name.to_owned(), shape, Source::Constant(data.into()))
    }

    /// The numbers of `value`, whose gradient goes to `gradient` instead: how a choice is trained (straight-through). Costs nothing.
    ///
    /// # Errors
    /// When the two do not have the same shape.
    pub fn straight_through(&mut self, value: Value, gradient: Value) -> Result<Value, GraphError> {
        let shape = self.shape(value).clone();
        self.expect("straight_through", gradient, &shape)?;
        let name = self.value_name(value).to_owned();
        Ok(self.add(name, shape, Source::StraightThrough { value, gradient: Some(gradient) }))
    }

    /// The numbers of `value`, as a constant to derivatives: a gradient ends here. Costs nothing.
    pub fn detach(&mut self, value: Value) -> Value {
        let (name, shape) = (self.value_name(value).to_owned(), self.shape(value).clone());
        self.add(name, shape, Source::StraightThrough { value, gradient: None })
    }

    /// The same numbers under another shape; costs nothing.
    ///
    /// # Errors
    /// When the number of elements differs.
    pub fn reshape(&mut self, x: Value, shape: impl Into<Shape>) -> Result<Value, GraphError> {
        let shape = shape.into();
        if shape.elements() != self.shape(x).elements() {
            return Err(self.misfit("reshape", x, format!("the elements of {shape}")));
        }
        let name = self.value_name(x).to_owned();
        Ok(self.add(name, shape, Source::Reshape(x)))
    }
}

impl<O: Operation> Graph<O> {
    /// Adds a node with outputs of the given shapes, named after it until the caller names them.
    pub(crate) fn push(&mut self, op: impl Into<O>, shapes: impl IntoIterator<Item = Shape>) -> SmallVec<[Value; 3]> {
        let op = op.into();
        let index = self.nodes.len();
        let name = format!("{}#{index}", op.name());
        let outputs: SmallVec<[Value; 3]> =
            shapes.into_iter().map(|shape| self.add(name.clone(), shape, Source::Node(index))).collect();
        self.nodes.push(Node { op, outputs: outputs.clone() });
        outputs
    }

    pub(crate) fn push_one(&mut self, op: impl Into<O>, shape: impl Into<Shape>) -> Value {
        self.push(op, [shape.into()])[0]
    }
}
