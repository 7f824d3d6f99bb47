//! Indices and mask of the k largest of each row.

use omnix_kernels::{KernelError, top_k};

use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Indices (u32, ascending) and mask of the k largest of each row.
#[derive(Clone, Debug)]
pub struct TopK {
    /// `[rows, n]`.
    pub x: Value,
    /// The number of elements chosen from each row.
    pub k: usize,
    /// Whether indices count over all rows (plus row · n).
    pub flat: bool,
}

impl<O: Operation + From<TopK>> Graph<O> {
    /// Indices (u32 `[rows, k]`, ascending) and 0/1 mask `[rows, n]` of the `k` largest of each row; ties: lower index.
    ///
    /// # Errors
    /// When `x` is not a matrix, or narrower than `k`.
    pub fn top_k(&mut self, x: Value, k: usize) -> Result<(Value, Value), GraphError> {
        self.top_k_indices(x, k, false)
    }

    /// As [`Graph::top_k`] with indices that count over all rows: row r of `x` starts at r · n, so that they can gather rows of
    /// a `[rows · n, ..]` matrix.
    ///
    /// # Errors
    /// As [`Graph::top_k`].
    pub fn top_k_flat(&mut self, x: Value, k: usize) -> Result<(Value, Value), GraphError> {
        self.top_k_indices(x, k, true)
    }

    fn top_k_indices(&mut self, x: Value, k: usize, flat: bool) -> Result<(Value, Value), GraphError> {
        let [rows, n] = **self.shape(x) else { return Err(self.misfit("top_k", x, "[rows, n]")) };
        if k == 0 || k > n {
            return Err(self.misfit("top_k", x, format!("at least {k} columns")));
        }
        let outputs = self.push(TopK { x, k, flat }, [Shape::from([rows, k]), Shape::from([rows, n])]);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for TopK {
    fn name(&self) -> &'static str {
        "top_k"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let shape = site.values.shape(self.x);
        let spec = top_k::TopK { rows: site.n(shape[0])?, n: site.n(shape[1])?, k: site.n(self.k)?, flat: self.flat };
        site.call([self.x, site.outputs[0], site.outputs[1]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
