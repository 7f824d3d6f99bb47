//! Convolutions and resizing over `[frame, row, column, channel]`.

use omnix_kernels::Activation;

use crate::error::GraphError;
use crate::graph::{Graph, Value};
use crate::op::{Conv2d, Corners, Filter, Op, WeightForm};

impl Graph {
    /// Convolution with `w [out, in, rows, columns]`, zero padding.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn conv2d(
        &mut self,
        x: Value,
        w: Value,
        bias: Option<Value>,
        stride: usize,
        padding: usize,
    ) -> Result<Value, GraphError> {
        let [frames, h, width, channels] = self.map_dims("conv2d", x)?;
        let (out, rows, columns) = match **self.shape(w) {
            [out, depth, rows, columns] if depth == channels => (out, rows, columns),
            _ => return Err(self.misfit("conv2d", w, format!("[out, {channels}, rows, columns]"))),
        };
        if let Some(bias) = bias {
            self.expect("conv2d", bias, &[out])?;
        }
        if h + 2 * padding < rows || width + 2 * padding < columns {
            return Err(self.misfit("conv2d", x, format!("at least {rows} x {columns} pixels with padding {padding}")));
        }
        let side = |n: usize, k: usize| (n + 2 * padding - k) / stride + 1;
        let shape = [frames, side(h, rows), side(width, columns), out];
        let form = WeightForm::Conv;
        let op = Conv2d {
            x,
            w,
            form,
            bias,
            stride,
            padding,
            relu_input: false,
            act: Activation::None,
            residuals: [None; 2],
        };
        Ok(self.push_one(Op::Conv2d(op), shape))
    }

    /// Transposed convolution with `w [in, out, k, k]` and stride `k`: blocks do not overlap, so it is a linear
    /// layer of `out · k²` columns and a copy that spreads each pixel's block.
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

    /// To `rows × columns`.
    ///
    /// # Errors
    /// When `x` is no map.
    pub fn resize(
        &mut self,
        x: Value,
        rows: usize,
        columns: usize,
        filter: Filter,
        corners: Corners,
    ) -> Result<Value, GraphError> {
        self.resize_coded(x, [rows, columns], filter, corners, None)
    }

    /// [`Graph::resize`] to `[rows, columns]`, plus a code whose first half of channels depends on the column alone and whose second
    /// half on the row: `code` is `[columns + rows, c/2]`, columns first.
    ///
    /// # Errors
    /// When `x` is no map, or the code has another shape.
    pub fn resize_coded(
        &mut self,
        x: Value,
        [rows, columns]: [usize; 2],
        filter: Filter,
        corners: Corners,
        code: Option<Value>,
    ) -> Result<Value, GraphError> {
        let [frames, _, _, channels] = self.map_dims("resize", x)?;
        if let Some(code) = code {
            self.expect("resize", code, &[columns + rows, channels / 2])?;
        }
        Ok(self.push_one(Op::Resize { x, filter, corners, code }, [frames, rows, columns, channels]))
    }
}
