//! Functions of one value or of two, element by element; the gradient of a function of one; the choice between two.

use omnix_kernels::KernelError;
use omnix_kernels::pointwise::{self, Binary, Pointwise, PointwiseOp, Unary};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, RowWise, Site, Value, Values};

/// `op(x)`.
#[derive(Clone, Debug)]
pub struct Map {
    /// What to compute.
    pub op: Unary,
    /// Operand.
    pub x: Value,
}

/// `op(a, b)`.
#[derive(Clone, Debug)]
pub struct Zip {
    /// What to compute.
    pub op: Binary,
    /// First operand; the output's shape.
    pub a: Value,
    /// Second operand.
    pub b: Operand,
}

/// The second operand of a pointwise operation: element `i` pairs with `value[(i / div) % len]`.
#[derive(Clone, Copy, Debug)]
pub struct Operand {
    /// The operand.
    pub value: Value,
    /// Repeats of one element.
    pub div: usize,
    /// Elements until it starts again.
    pub len: usize,
}

/// `dy · op'(x)`.
#[derive(Clone, Debug)]
pub struct MapGrad {
    /// The operation that `x` went into.
    pub op: Unary,
    /// Its operand.
    pub x: Value,
    /// Gradient of its result.
    pub dy: Value,
}

/// `a` where the mask is not 0, else `b`.
#[derive(Clone, Debug)]
pub struct Select {
    /// Where it is not 0 (NaN is not 0), `a` is taken.
    pub mask: Operand,
    /// Taken there; the output's shape.
    pub a: Value,
    /// Taken elsewhere.
    pub b: Value,
}

impl<O: Operation + From<MapGrad>> Graph<O> {
    /// The gradient of [`Graph::map`]: `dy · op'(x)`, element by element.
    ///
    /// # Errors
    /// When the shapes differ.
    pub fn map_grad(&mut self, op: Unary, x: Value, dy: Value) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        if *self.shape(dy) != shape {
            return Err(self.misfit("pointwise", dy, format!("{shape}")));
        }
        Ok(self.push_one(MapGrad { op, x, dy }, shape))
    }
}

impl<O: Operation + From<Select>> Graph<O> {
    /// `a` where `mask` is not 0, else `b`, whatever the other one is: NaN that is not chosen leaves no trace. `a` and `b` have one
    /// shape, the mask has it too or is a number for each row of their last axis.
    ///
    /// # Errors
    /// When the shapes do not fit.
    pub fn select(&mut self, mask: Value, a: Value, b: Value) -> Result<Value, GraphError> {
        let shape = self.shape(a).clone();
        if *self.shape(b) != shape {
            return Err(self.misfit("select", b, format!("{shape}")));
        }
        let count = self.shape(mask).elements();
        let div = match count {
            _ if count == shape.elements() => 1,
            _ if count == shape.rows() => shape.width(),
            _ => return Err(self.misfit("select", mask, format!("{shape}, or a number for each of its rows"))),
        };
        Ok(self.push_one(Select { mask: Operand { value: mask, div, len: count }, a, b }, shape))
    }
}

impl<O: Operation + From<Map>> Graph<O> {
    /// `op(x)`, element by element.
    pub fn map(&mut self, op: Unary, x: Value) -> Value {
        let shape = self.shape(x).clone();
        self.push_one(Map { op, x }, shape)
    }
}

impl<O: Operation + From<Zip>> Graph<O> {
    /// `op(a, b)`; `b` has `a`'s shape, or a suffix of it (a row `[c]` under `[.., c]`, a table `[t, c]` under `[s, t, c]`),
    /// or is one number.
    ///
    /// # Errors
    /// When `b`'s shape is not a suffix of `a`'s.
    pub fn zip(&mut self, op: Binary, a: Value, b: Value) -> Result<Value, GraphError> {
        let (left, right) = (self.shape(a), self.shape(b));
        if !left.ends_with(right) && right.elements() != 1 {
            return Err(self.misfit("pointwise", b, format!("a suffix of {left}")));
        }
        let (shape, len) = (left.clone(), right.elements());
        Ok(self.push_one(Zip { op, a, b: Operand { value: b, div: 1, len } }, shape))
    }

    /// `op(a[r, ..], b[r])`: one number per row; `b` has as many elements as `a` has rows of its last axis.
    ///
    /// # Errors
    /// When it has not.
    pub fn zip_rows(&mut self, op: Binary, a: Value, b: Value) -> Result<Value, GraphError> {
        let shape = self.shape(a).clone();
        if self.shape(b).elements() != shape.rows() {
            return Err(self.misfit("pointwise", b, format!("one number for each of {} rows", shape.rows())));
        }
        let b = Operand { value: b, div: shape.width(), len: shape.rows() };
        Ok(self.push_one(Zip { op, a, b }, shape))
    }

    /// `op(a, b)` with the operand of another node over values of this shape.
    pub(crate) fn zip_operand(&mut self, op: Binary, a: Value, b: Operand) -> Value {
        let shape = self.shape(a).clone();
        self.push_one(Zip { op, a, b }, shape)
    }

    /// `a + b` as [`Graph::zip`].
    ///
    /// # Errors
    /// As [`Graph::zip`].
    pub fn add_values(&mut self, a: Value, b: Value) -> Result<Value, GraphError> {
        self.zip(Binary::Add, a, b)
    }
}

impl Operation for Map {
    fn name(&self) -> &'static str {
        "pointwise"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = Pointwise { n: site.n(site.elements(self.x))?, op: PointwiseOp::Unary(self.op) };
        site.call([Some(self.x), None, Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.x).rows(), 1, 1, 0))
    }
}

impl Operation for Zip {
    fn name(&self) -> &'static str {
        "pointwise"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.a, &mut self.b.value], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { op, a, b } = self;
        let count = site.elements(*a);
        // Operands as long as `a` are cut with it.
        let cut = b.len > 1 && b.div * b.len == site.values.shape(*a).elements();
        let len = if cut { count / b.div } else { b.len };
        let operand = pointwise::Operand { div: site.n(b.div)?, len: site.n(len)? };
        let spec = Pointwise { n: site.n(count)?, op: PointwiseOp::Binary(*op, operand) };
        site.call([Some(*a), Some(b.value), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        let (rows, width) = (values.shape(self.a).rows(), values.shape(self.a).width());
        let Operand { div, len, .. } = self.b;
        if div * len == rows * width && (div == 1 || div == width) && len > 1 {
            Some(RowWise::new(rows, 1, 2, 0))
        } else if len == 1 || (div == 1 && len == width) {
            Some(RowWise::new(rows, 1, 1, 1))
        } else if div == 1 && len.is_multiple_of(width) {
            Some(RowWise::new(rows, len / width, 1, 1))
        } else {
            None
        }
    }
}

impl Operation for MapGrad {
    fn name(&self) -> &'static str {
        "pointwise"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.dy], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = Pointwise::gradient(site.n(site.elements(self.x))?, self.op);
        site.call([self.x, self.dy, site.outputs[0]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        2 * values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.x).rows(), 1, 2, 0))
    }
}

impl Operation for Select {
    fn name(&self) -> &'static str {
        "pointwise"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.mask.value, &mut self.a, &mut self.b], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { mask, a, b } = self;
        let count = site.elements(*a);
        // The mask is cut with the rows.
        let operand = pointwise::Operand { div: site.n(mask.div)?, len: site.n(count / mask.div)? };
        let spec = Pointwise::select(site.n(count)?, operand);
        site.call([*a, mask.value, site.outputs[0], *b].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        values.shape(outputs[0]).elements() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        Some(RowWise::new(values.shape(self.a).rows(), 1, 3, 0))
    }
}
