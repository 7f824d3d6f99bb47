//! Linear layers, layer norm, SwiGLU, softmax, reductions.

use omnix_kernels::Activation;

use crate::error::GraphError;
use crate::graph::{Graph, Shape, Value};
use crate::op::{Linear, Op, ReduceOp, WeightForm};

/// `shape` with another last dimension.
fn with_width(shape: &Shape, width: usize) -> Shape {
    let mut dims = shape.to_vec();
    if let Some(last) = dims.last_mut() {
        *last = width;
    }
    Shape::from(dims.as_slice())
}

impl Graph {
    /// `x [.., k] · wᵀ + bias` with `w [n, k]`, `bias [n]`: `[.., n]`. The kernel `[n, channels, rows, columns]` of a
    /// convolution will do where each row of `x` is what it covers, in this order.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn linear(&mut self, x: Value, w: Value, bias: Option<Value>) -> Result<Value, GraphError> {
        let k = self.shape(x).width();
        let n = match &**self.shape(w) {
            [n, rest @ ..] if !rest.is_empty() && rest.iter().product::<usize>() == k => *n,
            _ => return Err(self.misfit("linear", w, format!("[n, {k}]"))),
        };
        self.linear_of(x, w, WeightForm::Linear, n, bias)
    }

    pub(crate) fn linear_of(
        &mut self,
        x: Value,
        w: Value,
        form: WeightForm,
        n: usize,
        bias: Option<Value>,
    ) -> Result<Value, GraphError> {
        if let Some(bias) = bias {
            let wanted = if form == WeightForm::ConvTranspose { self.shape(bias).elements() } else { n };
            self.expect("linear", bias, &[wanted])?;
        }
        let shape = with_width(self.shape(x), n);
        let op = Linear { x, w, form, bias, act: Activation::None, gamma: None, residual: None };
        Ok(self.push_one(Op::Linear(op), shape))
    }

    /// Layer norm over the last axis; `weight` and `bias` `[c]`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn layer_norm(
        &mut self,
        x: Value,
        weight: Option<Value>,
        bias: Option<Value>,
        eps: f32,
    ) -> Result<Value, GraphError> {
        let c = self.shape(x).width();
        for value in weight.into_iter().chain(bias) {
            self.expect("layer_norm", value, &[c])?;
        }
        let shape = self.shape(x).clone();
        Ok(self.push_one(Op::LayerNorm { x, weight, bias, eps, act: Activation::None }, shape))
    }

    /// `silu(a) · b` of `x = [a | b]`: `[.., 2h]` to `[.., h]`.
    ///
    /// # Errors
    /// When the width is odd.
    pub fn swiglu(&mut self, x: Value) -> Result<Value, GraphError> {
        let width = self.shape(x).width();
        if !width.is_multiple_of(2) {
            return Err(self.misfit("swiglu", x, "[.., an even width]"));
        }
        let shape = with_width(self.shape(x), width / 2);
        Ok(self.push_one(Op::SwiGlu { x }, shape))
    }

    /// Softmax over the last axis.
    pub fn softmax(&mut self, x: Value) -> Value {
        let shape = self.shape(x).clone();
        self.push_one(Op::Softmax { x }, shape)
    }

    /// Reduces axis `axis` away.
    ///
    /// # Errors
    /// When there is no such axis.
    pub fn reduce(&mut self, x: Value, op: ReduceOp, axis: usize) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        if axis >= shape.len() {
            return Err(self.misfit("reduce", x, format!("more than {axis} axes")));
        }
        let dims = [shape[..axis].iter().product(), shape[axis], shape[axis + 1..].iter().product()];
        let rest: Vec<usize> = shape.iter().enumerate().filter(|(i, _)| *i != axis).map(|(_, d)| *d).collect();
        Ok(self.push_one(Op::Reduce { x, op, dims }, Shape::from(rest.as_slice())))
    }
}
