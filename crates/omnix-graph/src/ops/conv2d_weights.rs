//! Gradients of a convolution's weights and bias over `[frame, row, column, channel]`.

use omnix_kernels::winograd_weights::WinogradWeights;
use omnix_kernels::{KernelError, conv2d_weights};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Gradients of a convolution's weights, and of its bias where it has one.
#[derive(Clone, Debug)]
pub struct Conv2dWeights {
    /// The convolution's input map.
    pub x: Value,
    /// Gradient of its output map.
    pub dy: Value,
    /// Rows and columns of the kernel.
    pub kernel: [usize; 2],
    /// Step in rows and columns.
    pub stride: usize,
    /// Zeros around the input.
    pub padding: usize,
    /// Whether the bias' gradient is wanted.
    pub bias: bool,
    /// Whether it is computed by Winograd's algorithm: not, until a plan decides.
    pub winograd: bool,
}

impl Conv2dWeights {
    /// The sum over pixels that it stands for, whatever computes it.
    pub(crate) fn spec(&self, values: &Values) -> Result<conv2d_weights::Conv2dWeights, KernelError> {
        let n = |n: usize| u32_of("conv2d_weights", n);
        let (x, dy) = (values.shape(self.x), values.shape(self.dy));
        Ok(conv2d_weights::Conv2dWeights {
            frames: n(x[0])?,
            hi: n(x[1])?,
            wi: n(x[2])?,
            ci: n(x[3])?,
            co: n(dy[3])?,
            kernel: [n(self.kernel[0])?, n(self.kernel[1])?],
            stride: n(self.stride)?,
            padding: n(self.padding)?,
            bias: self.bias,
        })
    }
}

impl<O: Operation + From<Conv2dWeights>> Graph<O> {
    /// `[out, in, rows, columns]`, and with `bias` also `[out]`, from the input `x` of a convolution with a kernel of `kernel` rows and
    /// columns and the gradient `dy` of its output.
    ///
    /// # Errors
    /// When `x` and `dy` are not the maps before and after such a convolution, or the stride is 0.
    pub fn conv2d_weights(
        &mut self,
        x: Value,
        dy: Value,
        kernel: [usize; 2],
        stride: usize,
        padding: usize,
        bias: bool,
    ) -> Result<(Value, Option<Value>), GraphError> {
        let [frames, _, _, ci] = self.map_dims("conv2d_weights", x)?;
        let [_, ho, wo, co] = self.map_dims("conv2d_weights", dy)?;
        let op = Conv2dWeights { x, dy, kernel, stride, padding, bias, winograd: false };
        let spec = op.spec(self)?;
        let [rows, columns] = spec.output().map(|n| n as usize);
        if self.shape(dy)[0] != frames || [ho, wo] != [rows, columns] || rows * columns * co == 0 {
            return Err(self.misfit("conv2d_weights", dy, format!("[{frames}, {rows}, {columns}, out]")));
        }
        // Scratch for the sums of sections; a size of at least 1, since a value has memory.
        let parts = Shape::from([spec.parts_words().max(1) as usize]);
        let db = Shape::from([if bias { co } else { 1 }]);
        let outputs = self.push(op, [Shape::from([co, ci, kernel[0], kernel[1]]), db, parts]);
        Ok((outputs[0], bias.then(|| outputs[1])))
    }
}

impl Operation for Conv2dWeights {
    fn name(&self) -> &'static str {
        "conv2d_weights"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.dy], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let args = [self.x, self.dy].into_iter().chain(site.outputs.iter().copied()).map(Some);
        let conv = self.spec(site.values)?;
        let dispatches =
            if self.winograd { WinogradWeights { conv }.record(site.caps)? } else { conv.record(site.caps)? };
        site.call(args, dispatches)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        let pixels: usize = values.shape(self.dy)[..3].iter().product();
        2 * values.shape(outputs[0]).elements() as u64 * pixels as u64
    }
}
