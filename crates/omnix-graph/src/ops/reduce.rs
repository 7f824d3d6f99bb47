//! Sum, mean, maximum, minimum or standard deviation over one axis, or over neighbouring axes together.

use std::ops::Range;

use omnix_kernels::KernelError;
use omnix_kernels::reduce::{self, ReduceOp};

use crate::error::{GraphError, u32_of};
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Over the middle axis of `[outer, n, inner]`.
#[derive(Clone, Debug)]
pub struct Reduce {
    /// Input.
    pub x: Value,
    /// Sum, mean, maximum, minimum or standard deviation.
    pub op: ReduceOp,
    /// `[outer, n, inner]`.
    pub dims: [usize; 3],
}

impl<O: Operation + From<Reduce>> Graph<O> {
    /// Reduces axis `axis` away.
    ///
    /// # Errors
    /// When there is no such axis.
    pub fn reduce(&mut self, x: Value, op: ReduceOp, axis: usize) -> Result<Value, GraphError> {
        self.reduce_axes(x, op, axis..axis.saturating_add(1))
    }

    /// Reduces everything to one number, a value without axes.
    ///
    /// # Errors
    /// When `x` is larger than kernels count.
    pub fn reduce_all(&mut self, x: Value, op: ReduceOp) -> Result<Value, GraphError> {
        self.reduce_axes(x, op, 0..self.shape(x).len())
    }

    /// Reduces the neighbouring axes `axes` away, as if they were one.
    ///
    /// # Errors
    /// When there are no such axes, or more elements than kernels count.
    pub fn reduce_axes(&mut self, x: Value, op: ReduceOp, axes: Range<usize>) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        if axes.end > shape.len() || axes.start > axes.end {
            return Err(self.misfit("reduce", x, format!("axes {axes:?}")));
        }
        let product = |dims: &[usize]| dims.iter().product::<usize>();
        let dims = [product(&shape[..axes.start]), product(&shape[axes.clone()]), product(&shape[axes.end..])];
        let rest: Vec<usize> = shape[..axes.start].iter().chain(&shape[axes.end..]).copied().collect();
        let mut shapes = vec![Shape::from(rest.as_slice())];
        // Long axes need scratch.
        let scratch = spec(dims, op)?.scratch();
        shapes.extend(scratch.iter().filter(|words| **words > 0).map(|words| Shape::from([*words as usize])));
        Ok(self.push(Reduce { x, op, dims }, shapes)[0])
    }
}

/// The kernel's view of it.
fn spec([outer, n, inner]: [usize; 3], op: ReduceOp) -> Result<reduce::Reduce, KernelError> {
    let n_of = |n: usize| u32_of("reduce", n);
    Ok(reduce::Reduce { outer: n_of(outer)?, n: n_of(n)?, inner: n_of(inner)?, op })
}

impl Operation for Reduce {
    fn name(&self) -> &'static str {
        "reduce"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let scratch = [site.outputs.get(1).copied(), site.outputs.get(2).copied()];
        let args = [Some(self.x), Some(site.outputs[0])].into_iter().chain(scratch);
        site.call(args, spec(self.dims, self.op)?.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
