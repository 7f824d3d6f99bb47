//! Gradients of matrix products and convolutions, recorded as their layers are: without epilogues, which only fusion adds.

use omnix_kernels::copy::{Copy as StridedCopy, Strided};

use super::gradients::{Gradients, Made, Rule};
use crate::error::{GraphError, u32_of};
use crate::graph::{Value, WeightForm};
use crate::ops::{Conv2d, Graph, Linear, ReduceOp};

/// `dx = dy W`, `dW = dyᵀ x`, `db = Σ dy` over rows.
impl Rule for Linear {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let Self { x, w, form, bias, .. } = *self;
        if gradients.wants(x) {
            let form = form.gradient().ok_or(GraphError::NotDifferentiable { op: "linear" })?;
            let k = graph.shape(x).width();
            let dx = graph.linear_of(dy, w, form, k, None)?;
            gradients.add(graph, x, dx)?;
        }
        if form == WeightForm::ConvTranspose {
            return transposed(graph, self, dy, gradients);
        }
        if gradients.wants(w) || gradients.wants_some(bias) {
            let (dw, db) = graph.linear_weights(x, dy, gradients.wants_some(bias))?;
            gradients.add(graph, w, dw)?;
            if let (Some(bias), Some(db)) = (bias, db) {
                gradients.add(graph, bias, db)?;
            }
        }
        Ok(())
    }
}

/// Weights `[in, out, k, k]` and bias `[out]` of a transposed convolution, whose columns go by (row, column, out).
fn transposed(graph: &mut Graph, op: &Linear, dy: Value, gradients: &mut Gradients) -> Result<(), GraphError> {
    let [inputs, out, rows, columns] = <[usize; 4]>::try_from(&**graph.shape(op.w))
        .map_err(|_| graph.misfit("conv_transpose2d", op.w, "[in, out, k, k]"))?;
    if gradients.wants(op.w) {
        let (dw, _) = graph.linear_weights(dy, op.x, false)?;
        let dw = graph.reshape(dw, [inputs, rows, columns, out])?;
        let dw = graph.permute(dw, &[0, 3, 1, 2])?;
        gradients.add(graph, op.w, dw)?;
    }
    if let Some(bias) = op.bias.filter(|bias| gradients.wants(*bias)) {
        let pixels = graph.shape(dy).elements() / out;
        let pixels = graph.reshape(dy, [pixels, out])?;
        let db = graph.reduce(pixels, ReduceOp::Sum, 0)?;
        gradients.add(graph, bias, db)?;
    }
    Ok(())
}

/// `dx` is a convolution of dy, with zeros between its pixels where the stride is more than 1, by the kernel turned around.
impl Rule for Conv2d {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        let Self { x, w, bias, stride, padding, .. } = *self;
        let kernel = [graph.shape(w)[2], graph.shape(w)[3]];
        if gradients.wants(x) {
            let [_, height, width, _] = graph.map_dims("conv2d", x)?;
            let spread = match stride {
                1 => dy,
                _ => spread(graph, dy, stride, [0, 1].map(|i| [height, width][i] + 2 * padding + 1 - kernel[i]))?,
            };
            let dx = graph.conv2d_gradient(spread, w, padding)?;
            gradients.add(graph, x, dx)?;
        }
        if gradients.wants(w) || gradients.wants_some(bias) {
            let (dw, db) = graph.conv2d_weights(x, dy, kernel, stride, padding, gradients.wants_some(bias))?;
            gradients.add(graph, w, dw)?;
            if let (Some(bias), Some(db)) = (bias, db) {
                gradients.add(graph, bias, db)?;
            }
        }
        Ok(())
    }
}

/// A map of `[rows, columns]` with the pixels of `x` at every `stride`-th place, and zeros elsewhere.
fn spread(graph: &mut Graph, x: Value, stride: usize, [rows, columns]: [usize; 2]) -> Result<Value, GraphError> {
    let [frames, h, w, channels] = graph.map_dims("conv2d", x)?;
    let n = |n: usize| u32_of("conv2d", n);
    let shape = [1, 1, n(frames)?, n(h)?, n(w)?, n(channels)?];
    let line = n(columns * channels)?;
    let to = [0, 0, n(rows * columns * channels)?, line * n(stride)?, n(stride * channels)?, 1];
    let dst = Strided { offset: 0, strides: to };
    let piece = StridedCopy { shape, src: Strided::contiguous(shape), dst };
    graph.in_zeros([frames, rows, columns, channels], vec![(x, piece)])
}
