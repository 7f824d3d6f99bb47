//! Sum, mean, maximum, minimum or standard deviation over one axis.

use omnix_kernels::KernelError;
use omnix_kernels::reduce::{self, ReduceOp};

use crate::error::GraphError;
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
        let shape = self.shape(x).clone();
        if axis >= shape.len() {
            return Err(self.misfit("reduce", x, format!("more than {axis} axes")));
        }
        let dims = [shape[..axis].iter().product(), shape[axis], shape[axis + 1..].iter().product()];
        let rest: Vec<usize> = shape.iter().enumerate().filter(|(i, _)| *i != axis).map(|(_, d)| *d).collect();
        Ok(self.push_one(Reduce { x, op, dims }, Shape::from(rest.as_slice())))
    }
}

impl Operation for Reduce {
    fn name(&self) -> &'static str {
        "reduce"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let [outer, n, inner] = self.dims;
        let spec = reduce::Reduce { outer: site.n(outer)?, n: site.n(n)?, inner: site.n(inner)?, op: self.op };
        site.call([Some(self.x), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
