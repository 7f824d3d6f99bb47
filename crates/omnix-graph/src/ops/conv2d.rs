//! Convolution over `[frame, row, column, channel]` with zero padding, prologue and epilogue.

use omnix_kernels::winograd::Winograd;
use omnix_kernels::{Activation, KernelError, WeightType, conv2d};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::storage::{packed_shape, stored_as};
use crate::graph::{Call, Graph, Operation, Packing, Site, Value, Values, WeightForm};

/// A convolution.
#[derive(Clone, Debug)]
pub struct Conv2d {
    /// Input map.
    pub x: Value,
    /// A parameter `[out, in, rows, columns]`.
    pub w: Value,
    /// How `w` is packed, which says by what algorithm the node is computed: the sum over taps until a plan decides.
    pub form: WeightForm,
    /// `[out]`.
    pub bias: Option<Value>,
    /// Step in rows and columns.
    pub stride: usize,
    /// Zeros around the input.
    pub padding: usize,
    /// Fused: the input passes a ReLU.
    pub relu_input: bool,
    /// Fused activation.
    pub act: Activation,
    /// Fused additions, of the output's shape.
    pub residuals: [Option<Value>; 2],
}

impl<O: Operation + From<Conv2d>> Graph<O> {
    /// Convolution with `w [out, in, rows, columns]`, zero padding.
    ///
    /// # Errors
    /// When a shape does not fit, or the stride is 0.
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
        if stride == 0 {
            return Err(self.misfit("conv2d", x, "a stride of at least 1"));
        }
        let side = |n: usize, k: usize| (n + 2 * padding - k) / stride + 1;
        let shape = [frames, side(h, rows), side(width, columns), out];
        let form = WeightForm::Conv;
        let (relu_input, act, residuals) = (false, Activation::None, [None; 2]);
        Ok(self.push_one(Conv2d { x, w, form, bias, stride, padding, relu_input, act, residuals }, shape))
    }
}

impl<O: Operation + From<Conv2d>> Graph<O> {
    /// The gradient of the input of a convolution with `w [out, in, rows, columns]` and this padding, from that of its result, with zeros
    /// between the pixels where the stride was more than 1.
    ///
    /// # Errors
    /// When a shape does not fit, the kernel is not square, or the padding is not less than its side.
    pub(crate) fn conv2d_gradient(&mut self, dy: Value, w: Value, padding: usize) -> Result<Value, GraphError> {
        let [frames, h, width, channels] = self.map_dims("conv2d", dy)?;
        let (inputs, k) = match **self.shape(w) {
            [out, inputs, rows, columns] if out == channels && rows == columns && padding < rows => (inputs, rows),
            _ => return Err(self.misfit("conv2d", w, format!("[{channels}, in, k, k] with k above the padding"))),
        };
        let side = |n: usize| n + k - 1 - 2 * padding;
        let (form, relu_input, act) = (WeightForm::ConvGradient, false, Activation::None);
        let (padding, residuals) = (k - 1 - padding, [None; 2]);
        let shape = [frames, side(h), side(width), inputs];
        let op = Conv2d { x: dy, w, form, bias: None, stride: 1, padding, relu_input, act, residuals };
        Ok(self.push_one(op, shape))
    }
}

impl Conv2d {
    /// The sum over taps that it stands for, whatever computes it.
    pub(crate) fn sum_over_taps(&self, values: &Values, storage: WeightType) -> Result<conv2d::Conv2d, KernelError> {
        let n = |n: usize| u32_of("conv2d", n);
        let (x, w) = (values.shape(self.x), values.shape(self.w));
        Ok(conv2d::Conv2d {
            frames: n(x[0])?,
            hi: n(x[1])?,
            wi: n(x[2])?,
            ci: n(x[3])?,
            kernel: [n(w[2])?, n(w[3])?],
            stride: n(self.stride)?,
            padding: n(self.padding)?,
            weights: packed_shape(w, self.form.by_taps(), stored_as(values, self.w, storage)),
            act: self.act,
            relu_input: self.relu_input,
            bias: self.bias.is_some(),
            residual: self.residuals[0].is_some(),
            residual2: self.residuals[1].is_some(),
        })
    }
}

impl Operation for Conv2d {
    fn name(&self) -> &'static str {
        "conv2d"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { x, w, bias, residuals, .. } = self;
        map_all([x, w].into_iter().chain(bias).chain(residuals.iter_mut().flatten()), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let conv = self.sum_over_taps(site.values, site.storage)?;
        let [first, second] = self.residuals;
        let args = [Some(self.x), Some(self.w), self.bias, first, second, Some(site.outputs[0])];
        if self.form.is_winograd() {
            let scratch = Some(site.outputs[1]);
            site.call(args.into_iter().chain([scratch]), Winograd { conv }.record(site.caps)?)
        } else {
            site.call(args, conv.record(site.caps)?)
        }
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        let w = values.shape(self.w);
        let taps = values.shape(self.x).width() * w[2] * w[3];
        2 * values.shape(outputs[0]).elements() as u64 * taps as u64
    }

    fn packing(&self, values: &Values, value: Value, storage: WeightType) -> Packing {
        if value == self.w { Packing::Matrix(self.form, stored_as(values, value, storage)) } else { Packing::Plain }
    }
}
