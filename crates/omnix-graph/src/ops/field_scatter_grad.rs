//! The gradient of [`super::FieldScatter`]: `dz[t, s, i] = dfield[s, t, index[s, i]]`.

use omnix_kernels::{KernelError, field_scatter_grad};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// The gradient of the tokens of a field.
#[derive(Clone, Debug)]
pub struct FieldScatterGrad {
    /// Gradient of the field, `[S, T, cells, c]`.
    pub dfield: Value,
    /// u32 `[S, K]`.
    pub index: Value,
}

impl<O: Operation + From<FieldScatterGrad>> Graph<O> {
    /// The gradient of [`Graph::field_scatter`] with respect to its tokens: `[T, S, K, c]` of `dfield [S, T, cells, c]` and u32
    /// `index [S, K]`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn field_scatter_grad(&mut self, dfield: Value, index: Value) -> Result<Value, GraphError> {
        let op = "field_scatter_grad";
        let [sources, times, cells, c] = <[usize; 4]>::try_from(&**self.shape(dfield))
            .map_err(|_| self.misfit(op, dfield, "[sources, times, cells, channels]"))?;
        let k = match **self.shape(index) {
            [images, k] if images == sources && k <= cells => k,
            _ => return Err(self.misfit(op, index, format!("[{sources}, at most {cells}]"))),
        };
        Ok(self.push_one(FieldScatterGrad { dfield, index }, [times, sources, k, c]))
    }
}

impl Operation for FieldScatterGrad {
    fn name(&self) -> &'static str {
        "field_scatter_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.dfield, &mut self.index], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (from, to) = (site.values.shape(self.dfield), site.values.shape(site.outputs[0]));
        let spec = field_scatter_grad::FieldScatterGrad {
            sources: site.n(from[0])?,
            times: site.n(from[1])?,
            k: site.n(to[2])?,
            cells: site.n(from[2])?,
            c: site.n(from[3])?,
        };
        site.call([self.dfield, self.index, site.outputs[0]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
