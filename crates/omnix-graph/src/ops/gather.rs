//! `y[r] = x[index[r]]`, whole rows.

use omnix_kernels::{KernelError, gather};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// Rows by index.
#[derive(Clone, Debug)]
pub struct Gather {
    /// `[n, ..]`.
    pub x: Value,
    /// u32 `[m]`.
    pub index: Value,
}

impl<O: Operation + From<Gather>> Graph<O> {
    /// `y[r] = x[index[r]]` over the first axis; `index` is u32 `[m]`. Where a gradient passes to `x`, each row is read at most once.
    ///
    /// # Errors
    /// When `index` is not a vector, or `x` has no rows to take.
    pub fn gather(&mut self, x: Value, index: Value) -> Result<Value, GraphError> {
        let [m] = **self.shape(index) else { return Err(self.misfit("gather", index, "[m]")) };
        let mut dims = self.shape(x).to_vec();
        let Some(rows) = dims.first_mut() else { return Err(self.misfit("gather", x, "[n, ..]")) };
        *rows = m;
        Ok(self.push_one(Gather { x, index }, dims.as_slice()))
    }
}

impl Operation for Gather {
    fn name(&self) -> &'static str {
        "gather"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.index], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (from, m) = (site.values.shape(self.x), site.values.shape(self.index).elements());
        let spec = gather::Gather { n: site.n(from[0])?, m: site.n(m)?, c: site.product(&from[1..])? };
        site.call([Some(self.x), Some(self.index), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
