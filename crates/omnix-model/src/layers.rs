//! Layers with the names of their tensors: `weight` and `bias` below a scope.

use std::ops::Range;

use omnix_graph::ops::{Binary, Corners, Filter, Unary};
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

/// `x Wᵀ + b`, W `[n, k]`.
pub(crate) fn linear(g: &mut Graph, at: &Scope, x: Value, n: usize) -> Result<Value, GraphError> {
    let k = g.shape(x).width();
    linear_rows(g, at, x, n, 0..n, &[n, k])
}

/// `x Wᵀ + b` with W (its shape is `full`) stored as f32 even where matrices are f16: for the first layer, whose
/// rounding every other layer inherits, and the camera decoder, whose nine numbers every point of a view depends on.
/// Both are small.
pub(crate) fn precise_linear(g: &mut Graph, at: &Scope, x: Value, full: &[usize]) -> Result<Value, GraphError> {
    let weight = g.parameter(&at.name("weight"), full);
    g.keep_f32(weight);
    let bias = g.parameter(&at.name("bias"), [full[0]]);
    g.linear(x, weight, Some(bias))
}

/// `x Wᵀ + b` for a 1×1 convolution's W `[n, k, 1, 1]`.
pub(crate) fn pointwise_conv(g: &mut Graph, at: &Scope, x: Value, n: usize) -> Result<Value, GraphError> {
    let k = g.shape(x).width();
    linear_rows(g, at, x, n, 0..n, &[n, k, 1, 1])
}

/// The columns `rows` of the product with a matrix of shape `full`, whose first dimension is `n`.
pub(crate) fn linear_rows(
    g: &mut Graph,
    at: &Scope,
    x: Value,
    n: usize,
    rows: Range<usize>,
    full: &[usize],
) -> Result<Value, GraphError> {
    let weight = g.parameter_rows(&at.name("weight"), full, rows.clone());
    let bias = g.parameter_rows(&at.name("bias"), [n], rows);
    g.linear(x, weight, Some(bias))
}

/// What the inputs in `columns` of a layer over inputs side by side add to its output: `x Wᵀ` with those columns of W
/// (its shape is `full`), with the bias if asked for.
pub(crate) fn linear_columns(
    g: &mut Graph,
    at: &Scope,
    x: Value,
    full: [usize; 2],
    columns: Range<usize>,
    bias: bool,
) -> Result<Value, GraphError> {
    let weight = g.parameter_columns(&at.name("weight"), full, columns);
    let bias = bias.then(|| g.parameter(&at.name("bias"), [full[0]]));
    g.linear(x, weight, bias)
}

/// Layer norm over the last axis.
pub(crate) fn layer_norm(g: &mut Graph, at: &Scope, x: Value, eps: f32) -> Result<Value, GraphError> {
    let c = g.shape(x).width();
    let weight = g.parameter(&at.name("weight"), [c]);
    let bias = g.parameter(&at.name("bias"), [c]);
    g.layer_norm(x, Some(weight), Some(bias), eps)
}

/// 3×3 convolution to `out` channels with padding 1.
pub(crate) fn conv3(g: &mut Graph, at: &Scope, x: Value, out: usize, stride: usize) -> Result<Value, GraphError> {
    let bias = g.parameter(&at.name("bias"), [out]);
    conv3_with(g, at, x, out, Some(bias), stride)
}

/// 3×3 convolution without bias.
pub(crate) fn conv3_plain(g: &mut Graph, at: &Scope, x: Value, out: usize) -> Result<Value, GraphError> {
    conv3_with(g, at, x, out, None, 1)
}

fn conv3_with(
    g: &mut Graph,
    at: &Scope,
    x: Value,
    out: usize,
    bias: Option<Value>,
    stride: usize,
) -> Result<Value, GraphError> {
    let channels = g.shape(x).width();
    let weight = g.parameter(&at.name("weight"), [out, channels, 3, 3]);
    g.conv2d(x, weight, bias, stride, 1)
}

/// Transposed convolution, `k`×`k` with stride `k`, channels kept.
pub(crate) fn conv_transpose(g: &mut Graph, at: &Scope, x: Value, k: usize) -> Result<Value, GraphError> {
    let c = g.shape(x).width();
    let weight = g.parameter(&at.name("weight"), [c, c, k, k]);
    let bias = g.parameter(&at.name("bias"), [c]);
    g.conv_transpose2d(x, weight, Some(bias))
}

/// `residual + gamma · x`, gamma below `at`.
pub(crate) fn scaled_residual(g: &mut Graph, at: &Scope, x: Value, residual: Value) -> Result<Value, GraphError> {
    let gamma = g.parameter(&at.name("gamma"), [g.shape(x).width()]);
    let scaled = g.zip(Binary::Mul, x, gamma)?;
    g.add_values(scaled, residual)
}

/// `x + at.scale · branch`, or `x + branch` where a network has no layer scale.
pub(crate) fn branch(g: &mut Graph, at: Option<&Scope>, branch: Value, x: Value) -> Result<Value, GraphError> {
    match at {
        Some(at) => scaled_residual(g, at, branch, x),
        None => g.add_values(branch, x),
    }
}

/// Bilinear with corners on corners, the only resizing in the heads.
pub(crate) fn resize(g: &mut Graph, x: Value, rows: usize, columns: usize) -> Result<Value, GraphError> {
    g.resize(x, rows, columns, Filter::Bilinear, Corners::Align)
}

/// `max(x, 0)`.
pub(crate) fn relu(g: &mut Graph, x: Value) -> Value {
    g.map(Unary::Relu, x)
}

/// The erf form.
pub(crate) fn gelu(g: &mut Graph, x: Value) -> Value {
    g.map(Unary::Gelu, x)
}
