//! `base` with `y[index[r]] = x[r]`, whole rows; each row is written at most once.

use omnix_kernels::copy::{Copy as StridedCopy, Strided};
use omnix_kernels::{KernelError, scatter};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// Rows written by index.
#[derive(Clone, Debug)]
pub struct Scatter {
    /// What the other rows keep.
    pub base: Value,
    /// `[m, ..]`.
    pub x: Value,
    /// u32 `[m]`.
    pub index: Value,
}

impl<O: Operation + From<Scatter>> Graph<O> {
    /// `base` with `y[index[r]] = x[r]`; each row is written at most once.
    ///
    /// # Errors
    /// When the rows of `x` and `base` differ, or `index` does not have one entry per row of `x`.
    pub fn scatter(&mut self, base: Value, x: Value, index: Value) -> Result<Value, GraphError> {
        let (base_shape, rows) = (self.shape(base).clone(), self.shape(x).clone());
        let Some((_, row)) = base_shape.split_first() else { return Err(self.misfit("scatter", base, "[n, ..]")) };
        if rows.get(1..) != Some(row) {
            return Err(self.misfit("scatter", x, format!("rows of {base_shape}")));
        }
        self.expect("scatter", index, &rows[..1])?;
        Ok(self.push_one(Scatter { base, x, index }, base_shape))
    }
}

impl Operation for Scatter {
    fn name(&self) -> &'static str {
        "scatter"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.base, &mut self.x, &mut self.index], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { base, x, index } = *self;
        let (shape, y) = (site.values.shape(base), site.outputs[0]);
        let m = site.n(site.values.shape(index).elements())?;
        let spec = scatter::Scatter { n: site.n(shape[0])?, m, c: site.product(&shape[1..])? };
        let dims = [1, 1, 1, 1, 1, site.n(shape.elements())?];
        let side = Strided::contiguous(dims);
        let mut calls =
            site.call([Some(base), Some(y)], StridedCopy { shape: dims, src: side, dst: side }.record(site.caps)?)?;
        calls.extend(site.call([Some(x), Some(index), Some(y)], spec.record(site.caps)?)?);
        Ok(calls)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
