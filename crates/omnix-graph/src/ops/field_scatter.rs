//! `field[s, t, index[s, i]] = z[t, s, i]`, `rest` elsewhere: tokens at their cells of a field.

use omnix_kernels::{KernelError, field_scatter};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// A field out of the tokens that move.
#[derive(Clone, Debug)]
pub struct FieldScatter {
    /// `[T, S, K, c]`.
    pub z: Value,
    /// u32 `[S, K]`, ascending.
    pub index: Value,
    /// `[c]`.
    pub rest: Value,
}

impl<O: Operation + From<FieldScatter>> Graph<O> {
    /// `field[s, t, index[s, i]] = z[t, s, i]` and `rest [c]` elsewhere: `[S, T, cells, c]` of `z [T, S, K, c]` and u32
    /// `index [S, K]`, ascending in each row.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn field_scatter(&mut self, z: Value, index: Value, rest: Value, cells: usize) -> Result<Value, GraphError> {
        let op = "field_scatter";
        let [times, sources, k, c] = <[usize; 4]>::try_from(&**self.shape(z))
            .map_err(|_| self.misfit(op, z, "[times, sources, tokens, channels]"))?;
        if k > cells {
            return Err(self.misfit(op, z, format!("at most {cells} tokens of an image")));
        }
        if self.shape(index).elements() != sources * k {
            return Err(self.misfit(op, index, format!("[{sources}, {k}]")));
        }
        self.expect(op, rest, &[c])?;
        Ok(self.push_one(FieldScatter { z, index, rest }, [sources, times, cells, c]))
    }
}

impl Operation for FieldScatter {
    fn name(&self) -> &'static str {
        "field_scatter"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.z, &mut self.index, &mut self.rest], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (from, to) = (site.values.shape(self.z), site.values.shape(site.outputs[0]));
        let spec = field_scatter::FieldScatter {
            sources: site.n(to[0])?,
            times: site.n(to[1])?,
            k: site.n(from[2])?,
            cells: site.n(to[2])?,
            c: site.n(to[3])?,
        };
        site.call([self.z, self.index, self.rest, site.outputs[0]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
