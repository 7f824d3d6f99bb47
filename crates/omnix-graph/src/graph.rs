//! Values, nodes and the graph that holds them.

use std::borrow::Cow;
use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

use smallvec::SmallVec;

use crate::op::Op;

/// Dimensions, outermost first. A scalar has none.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Shape(SmallVec<[usize; 6]>);

impl Shape {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.0.iter().product()
    }

    /// Bytes of 32-bit elements.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(|d| *d as u64).product::<u64>() * 4
    }

    /// The last dimension; 1 for a scalar.
    #[must_use]
    pub fn width(&self) -> usize {
        self.0.last().copied().unwrap_or(1)
    }

    /// Product of all dimensions but the last.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.0.split_last().map_or(1, |(_, rest)| rest.iter().product())
    }
}

impl Deref for Shape {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.0
    }
}

impl<const N: usize> From<[usize; N]> for Shape {
    fn from(dims: [usize; N]) -> Self {
        Self(dims.into_iter().collect())
    }
}

impl From<&[usize]> for Shape {
    fn from(dims: &[usize]) -> Self {
        Self(dims.into())
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.0.as_slice())
    }
}

/// A handle to a value of one graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Value(pub(crate) u32);

/// A tensor of the checkpoint, or a block of it: some leading rows (the q, k, v parts of one matrix), some columns (what
/// one of several inputs side by side is multiplied by).
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Parameter {
    /// Name as the [`crate::ParameterSource`] knows it.
    pub name: Arc<str>,
    /// Shape of the whole tensor in the checkpoint.
    pub full: Shape,
    /// Rows of its first dimension that this value stands for.
    pub rows: Range<usize>,
    /// Columns, where it does not stand for whole rows; the tensor is a matrix then.
    pub columns: Option<Range<usize>>,
    /// Stored as f32 even where the plan stores matrices as f16.
    pub keep_f32: bool,
}

impl Parameter {
    /// The shape of the block.
    #[must_use]
    pub fn shape(&self) -> Shape {
        let mut dims = self.full.to_vec();
        if let Some(first) = dims.first_mut() {
            *first = self.rows.len();
        }
        if let (Some(columns), Some(last)) = (&self.columns, dims.last_mut()) {
            *last = columns.len();
        }
        Shape::from(dims.as_slice())
    }

    /// The numbers of the block, out of all of the tensor's.
    #[must_use]
    pub fn block<'a>(&self, all: &'a [f32]) -> Cow<'a, [f32]> {
        let row: usize = self.full.get(1..).map_or(1, |rest| rest.iter().product());
        let rows = &all[self.rows.start * row..self.rows.end * row];
        match &self.columns {
            None => Cow::Borrowed(rows),
            Some(columns) => rows.chunks_exact(row).flat_map(|r| &r[columns.clone()]).copied().collect(),
        }
    }

    /// The indices in the whole tensor of the block's number `at`, counted row by row.
    #[must_use]
    pub fn indices(&self, at: usize) -> Vec<usize> {
        let mut rest = at;
        let shape = self.shape();
        let mut indices: Vec<usize> = shape.iter().rev().map(|n| (rest % n, rest /= n).0).collect();
        indices.reverse();
        if let Some(first) = indices.first_mut() {
            *first += self.rows.start;
        }
        if let (Some(columns), Some(last)) = (&self.columns, indices.last_mut()) {
            *last += columns.start;
        }
        indices
    }
}

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
}

/// One operation and what it makes.
#[derive(Clone, Debug)]
pub struct Node {
    /// The operation with its arguments.
    pub op: Op,
    /// Its results; some operations have several.
    pub outputs: SmallVec<[Value; 3]>,
}

/// A recorded computation. Nodes are in an order in which they can run.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    pub(crate) values: Vec<ValueInfo>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) outputs: Vec<Value>,
    taps: Vec<String>,
}

impl Graph {
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

    /// What is known about `value`.
    #[must_use]
    pub fn info(&self, value: Value) -> &ValueInfo {
        &self.values[value.0 as usize]
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

    /// The nodes in order.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The outputs in the order they were declared.
    #[must_use]
    pub fn outputs(&self) -> &[Value] {
        &self.outputs
    }

    /// All values, by index.
    pub fn values(&self) -> impl Iterator<Item = (Value, &ValueInfo)> {
        self.values.iter().enumerate().map(|(i, info)| (Value(i as u32), info))
    }

    /// Finds an input or output (or any value) by name; the last one wins.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<Value> {
        self.values.iter().rposition(|v| v.name == name).map(|i| Value(i as u32))
    }

    /// Names `value`; if the name is one of the taps it becomes an output.
    pub fn name(&mut self, value: Value, name: &str) -> Value {
        name.clone_into(&mut self.values[value.0 as usize].name);
        if self.taps.iter().any(|t| t == name) {
            self.output(value, name);
        }
        value
    }

    /// Keeps `value` under `name` after the run.
    pub fn output(&mut self, value: Value, name: &str) {
        name.clone_into(&mut self.values[value.0 as usize].name);
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
    /// over each of them: so nobody has to put them side by side.
    pub fn parameter_columns(&mut self, name: &str, [n, k]: [usize; 2], columns: Range<usize>) -> Value {
        let full = Shape::from([n, k]);
        self.add_parameter(Parameter { name: name.into(), full, rows: 0..n, columns: Some(columns), keep_f32: false })
    }

    /// Stores a parameter as f32 whatever the plan stores: for the few matrices on whose accuracy everything else
    /// depends.
    pub fn keep_f32(&mut self, value: Value) {
        if let Source::Parameter(parameter) = &mut self.values[value.0 as usize].source {
            parameter.keep_f32 = true;
        }
    }

    fn add_parameter(&mut self, parameter: Parameter) -> Value {
        let known = self.values.iter().position(|v| matches!(&v.source, Source::Parameter(p) if *p == parameter));
        if let Some(index) = known {
            return Value(index as u32);
        }
        let name = parameter.name.to_string();
        self.add(name, parameter.shape(), Source::Parameter(parameter))
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

    pub(crate) fn add(&mut self, name: String, shape: Shape, source: Source) -> Value {
        let physical = shape.clone();
        self.values.push(ValueInfo { name, shape, source, physical });
        Value((self.values.len() - 1) as u32)
    }

    /// Adds a node with outputs of the given shapes, named after it until the caller names them.
    pub(crate) fn push(&mut self, op: Op, shapes: impl IntoIterator<Item = Shape>) -> SmallVec<[Value; 3]> {
        let index = self.nodes.len();
        let name = format!("{}#{index}", op.name());
        let outputs: SmallVec<[Value; 3]> =
            shapes.into_iter().map(|shape| self.add(name.clone(), shape, Source::Node(index))).collect();
        self.nodes.push(Node { op, outputs: outputs.clone() });
        outputs
    }

    pub(crate) fn push_one(&mut self, op: Op, shape: impl Into<Shape>) -> Value {
        self.push(op, [shape.into()])[0]
    }

    /// The value whose memory `value` shares: follows reshapes.
    #[must_use]
    pub fn root(&self, value: Value) -> Value {
        let mut at = value;
        while let Source::Reshape(inner) = self.info(at).source {
            at = inner;
        }
        at
    }
}
