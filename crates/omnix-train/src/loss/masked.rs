//! Numbers under a mask: what all terms share.
//!
//! A product with a mask of 0 does not take NaN out, and a derivative that is infinite times 0 is NaN. So every prediction and target
//! goes through [`keep`] first, which puts 0 where the mask is 0, and passes no gradient there; and functions without a derivative at 0
//! are kept away from it.

use omnix_graph::ops::{Binary, Graph, ReduceOp, Unary};
use omnix_graph::{GraphError, Value};

use super::config::Norm;

/// A recorded term: one number, and the numbers it is made of.
#[derive(Clone, Debug)]
pub(super) struct Term {
    /// Its value, without its weight in the total.
    pub(super) value: Value,
    /// How many valid entries it has.
    pub(super) entries: Value,
    /// Its parts by name.
    pub(super) parts: Vec<(&'static str, Value)>,
}

/// Checks that `value` is exactly `dims`.
pub(super) fn expect(graph: &Graph, op: &'static str, value: Value, dims: &[usize]) -> Result<(), GraphError> {
    let got = graph.shape(value);
    if **got == *dims {
        return Ok(());
    }
    let value = graph.value_name(value).to_owned();
    Err(GraphError::Shape { op, value, expected: format!("{dims:?}"), got: got.clone() })
}

/// The dimensions of `value`, which must have `N`; `axes` says what they are.
pub(super) fn dims<const N: usize>(
    graph: &Graph,
    op: &'static str,
    value: Value,
    axes: &str,
) -> Result<[usize; N], GraphError> {
    let got = graph.shape(value);
    <[usize; N]>::try_from(&**got).map_err(|_| {
        let value = graph.value_name(value).to_owned();
        GraphError::Shape { op, value, expected: axes.to_owned(), got: got.clone() }
    })
}

/// `x` where `mask` is not 0, else 0. The mask has the shape of `x`, or a number for each row of its last axis.
pub(super) fn keep(graph: &mut Graph, x: Value, mask: Value) -> Result<Value, GraphError> {
    if graph.shape(x) == graph.shape(mask) {
        graph.zip(Binary::Keep, x, mask)
    } else {
        graph.zip_rows(Binary::Keep, x, mask)
    }
}

/// `x` where `mask` is 1, and 1 where it is 0. Both have one shape.
///
/// Made from the mask and not from a tensor of ones, here and below: what no input reaches would be kept on the device for good.
pub(super) fn keep_or_one(graph: &mut Graph, x: Value, mask: Value) -> Result<Value, GraphError> {
    let x = keep(graph, x, mask)?;
    let rest = graph.map(Unary::ScaleShift { s: -1.0, t: 1.0 }, mask);
    graph.add_values(x, rest)
}

/// `x` where `mask` is not 0, else NaN. Both have one shape.
pub(super) fn keep_or_nan(graph: &mut Graph, x: Value, mask: Value) -> Result<Value, GraphError> {
    let nan = graph.constant("loss.nan", [1], vec![f32::NAN]);
    let nans = graph.add_values(x, nan)?;
    graph.select(mask, x, nans)
}

/// `prediction - target` where `mask` is not 0, else 0.
pub(super) fn difference(
    graph: &mut Graph,
    prediction: Value,
    target: Value,
    mask: Value,
) -> Result<Value, GraphError> {
    let prediction = keep(graph, prediction, mask)?;
    let target = keep(graph, target, mask)?;
    graph.zip(Binary::Sub, prediction, target)
}

/// The norm of each row of the last axis. At the zero vector the derivative is 0.
pub(super) fn norm(graph: &mut Graph, x: Value, norm: Norm) -> Result<Value, GraphError> {
    let axis = graph.shape(x).len().saturating_sub(1);
    match norm {
        Norm::L1 => {
            let sizes = graph.map(Unary::Abs, x);
            graph.reduce(sizes, ReduceOp::Sum, axis)
        }
        Norm::L2 => {
            let squares = graph.map(Unary::Square, x);
            let squares = graph.reduce(squares, ReduceOp::Sum, axis)?;
            let zero = graph.constant("loss.zero", [1], vec![0.0]);
            let none = graph.zip(Binary::Equal, squares, zero)?;
            let safe = graph.add_values(squares, none)?;
            let length = graph.map(Unary::Sqrt, safe);
            keep(graph, length, squares)
        }
    }
}

/// The number of entries of a mask.
pub(super) fn count(graph: &mut Graph, mask: Value) -> Result<Value, GraphError> {
    graph.reduce_all(mask, ReduceOp::Sum)
}

/// `sum / count`; a count of 0 goes with a sum of 0, and gives 0.
pub(super) fn over(graph: &mut Graph, sum: Value, count: Value) -> Result<Value, GraphError> {
    let count = graph.map(Unary::Clamp { low: 1.0, high: f32::MAX }, count);
    graph.zip(Binary::Div, sum, count)
}

/// `x`, or 0 if there are fewer `entries` than `least`.
pub(super) fn if_enough(graph: &mut Graph, x: Value, entries: Value, least: u32) -> Result<Value, GraphError> {
    let few = graph.map(Unary::Below { limit: least as f32 }, entries);
    graph.zip(Binary::Drop, x, few)
}

/// `sum`, or something that is not finite where a number of `of` is not: clamps and ranks hide NaN, and training must stop at it. The
/// gradient is that of `sum`.
pub(super) fn visible(graph: &mut Graph, sum: Value, of: Value) -> Result<Value, GraphError> {
    let plain = graph.reduce_all(of, ReduceOp::Sum)?;
    let finite = graph.map(Unary::IsFinite, plain);
    let value = graph.select(finite, sum, plain)?;
    graph.straight_through(value, sum)
}

/// `s · x`.
pub(super) fn scale(graph: &mut Graph, x: Value, s: f32) -> Value {
    graph.map(Unary::ScaleShift { s, t: 0.0 }, x)
}
