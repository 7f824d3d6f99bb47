//! `dw = dyᵀ x` and `db = Σ dy` over rows: the gradients of a linear layer's weights and bias.

use omnix_kernels::{KernelError, linear_weights};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Gradients of a linear layer's weights, and of its bias where it has one.
#[derive(Clone, Debug)]
pub struct LinearWeights {
    /// The layer's input `[.., k]`.
    pub x: Value,
    /// Gradient of its output `[.., n]`, as many rows.
    pub dy: Value,
    /// Whether the bias' gradient is wanted.
    pub bias: bool,
}

impl<O: Operation + From<LinearWeights>> Graph<O> {
    /// `[n, k]`, row-major, and with `bias` also `[n]`, from `x [.., k]` and `dy [.., n]`.
    ///
    /// # Errors
    /// When the two do not have the same number of rows, or there are none.
    pub fn linear_weights(&mut self, x: Value, dy: Value, bias: bool) -> Result<(Value, Option<Value>), GraphError> {
        let (rows, k, n) = (self.shape(x).rows(), self.shape(x).width(), self.shape(dy).width());
        if self.shape(dy).rows() != rows || rows * n * k == 0 {
            return Err(self.misfit("linear_weights", dy, format!("{rows} rows, as x has, and none of the sizes 0")));
        }
        let size = |n: usize| u32_of("linear_weights", n);
        let spec = linear_weights::LinearWeights { m: size(rows)?, n: size(n)?, k: size(k)?, bias };
        // Scratch for the sums of sections; a size of at least 1, since a value has memory.
        let parts = Shape::from([spec.parts_words().max(1) as usize]);
        let db = Shape::from([if bias { n } else { 1 }]);
        let outputs = self.push(LinearWeights { x, dy, bias }, [Shape::from([n, k]), db, parts]);
        Ok((outputs[0], bias.then(|| outputs[1])))
    }
}

impl Operation for LinearWeights {
    fn name(&self) -> &'static str {
        "linear_weights"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.dy], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = linear_weights::LinearWeights {
            m: site.rows(self.x)?,
            n: site.width(self.dy)?,
            k: site.width(self.x)?,
            bias: self.bias,
        };
        let args = [self.x, self.dy, site.outputs[0], site.outputs[1], site.outputs[2]].map(Some);
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        2 * values.shape(outputs[0]).elements() as u64 * values.shape(self.x).rows() as u64
    }
}
