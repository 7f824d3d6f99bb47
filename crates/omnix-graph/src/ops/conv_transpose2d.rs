//! Transposed convolution whose blocks do not overlap: recorded as a linear layer and a copy, so it is no operation of its own.

use super::copy::Copies;
use super::linear::Linear;
use crate::error::GraphError;
use crate::graph::{Graph, Operation, Value, WeightForm};

impl<O: Operation + From<Linear> + From<Copies>> Graph<O> {
    /// Transposed convolution with `w [in, out, k, k]` and stride `k`: a linear layer of `out · k²` columns and a copy that
    /// spreads each pixel's block.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn conv_transpose2d(&mut self, x: Value, w: Value, bias: Option<Value>) -> Result<Value, GraphError> {
        let [frames, h, width, channels] = self.map_dims("conv_transpose2d", x)?;
        let (out, k) = match **self.shape(w) {
            [depth, out, k, columns] if depth == channels && k == columns => (out, k),
            _ => return Err(self.misfit("conv_transpose2d", w, format!("[{channels}, out, k, k]"))),
        };
        if let Some(bias) = bias {
            self.expect("conv_transpose2d", bias, &[out])?;
        }
        let blocks = self.linear_of(x, w, WeightForm::ConvTranspose, out * k * k, bias)?;
        let split = self.reshape(blocks, [frames * h, width, k, k, out])?;
        let spread = self.permute(split, &[0, 2, 1, 3, 4])?;
        self.reshape(spread, [frames, h * k, width * k, out])
    }
}
