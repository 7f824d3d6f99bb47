//! Gather, scatter, top-k and the reference view: what moves whole rows by index.

use crate::error::GraphError;
use crate::graph::{Graph, Shape, Value};
use crate::op::{Op, Strategy};

impl Graph {
    /// `y[r] = x[index[r]]` over the first axis; `index` is u32 `[m]`.
    ///
    /// # Errors
    /// When `index` is no vector.
    pub fn gather(&mut self, x: Value, index: Value) -> Result<Value, GraphError> {
        let [m] = **self.shape(index) else { return Err(self.misfit("gather", index, "[m]")) };
        let mut dims = self.shape(x).to_vec();
        dims[0] = m;
        Ok(self.push_one(Op::Gather { x, index }, dims.as_slice()))
    }

    /// `base` with `y[index[r]] = x[r]`; each row is written at most once.
    ///
    /// # Errors
    /// When the rows of `x` and `base` differ, or `index` does not have one entry a row of `x`.
    pub fn scatter(&mut self, base: Value, x: Value, index: Value) -> Result<Value, GraphError> {
        let (base_shape, rows) = (self.shape(base).clone(), self.shape(x).clone());
        if base_shape[1..] != rows[1..] {
            return Err(self.misfit("scatter", x, format!("rows of {base_shape}")));
        }
        self.expect("scatter", index, &rows[..1])?;
        Ok(self.push_one(Op::Scatter { base, x, index }, base_shape))
    }

    /// Indices (u32 `[rows, k]`, ascending) and 0/1 mask `[rows, n]` of the `k` largest of each row; ties: lower index.
    ///
    /// # Errors
    /// When `x` is no matrix or narrower than `k`.
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
        let outputs = self.push(Op::TopK { x, k, flat }, [Shape::from([rows, k]), Shape::from([rows, n])]);
        Ok((outputs[0], outputs[1]))
    }

    /// Picks the reference among class tokens `[views, c]`: `(order, inverse, reference)`, u32, `order[0]` the reference.
    ///
    /// # Errors
    /// When `x` is no matrix.
    pub fn reference_view(&mut self, x: Value, strategy: Strategy) -> Result<(Value, Value, Value), GraphError> {
        let [views, _] = **self.shape(x) else { return Err(self.misfit("reference_view", x, "[views, channels]")) };
        let shapes = [Shape::from([views]), Shape::from([views]), Shape::from([1])];
        let outputs = self.push(Op::ReferenceView { x, strategy }, shapes);
        Ok((outputs[0], outputs[1], outputs[2]))
    }
}
