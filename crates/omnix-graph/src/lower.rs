//! From an operation to the kernel calls that compute it, for all rows or for a chunk of them.

mod motion;

use omnix_kernels::attention::Attention;
use omnix_kernels::gather::Gather;
use omnix_kernels::layer_norm::LayerNorm;
use omnix_kernels::linear::Linear;
use omnix_kernels::pointwise::{Operand, Pointwise, PointwiseOp};
use omnix_kernels::reduce::Reduce;
use omnix_kernels::reference_view::ReferenceView;
use omnix_kernels::resize::Resize;
use omnix_kernels::scatter::Scatter;
use omnix_kernels::softmax::Softmax;
use omnix_kernels::split_heads::SplitHeads;
use omnix_kernels::swiglu::SwiGlu;
use omnix_kernels::top_k::TopK;
use omnix_kernels::winograd::Winograd;
use omnix_kernels::{Dispatch, KernelError};
use smallvec::{SmallVec, smallvec};

use crate::algorithm;
use crate::graph::{Node, Value};
use crate::op::{Op, StridedCopy, WeightForm};
use crate::plan::{Plan, packed_shape, stored_as};
use crate::record::too_large;

/// One kernel call: arguments in the order of the kernel's `Arg` constants.
pub(crate) struct Call {
    pub(crate) args: SmallVec<[Option<Value>; 8]>,
    pub(crate) dispatches: Vec<Dispatch>,
}

fn u32_of(kernel: &'static str, n: usize) -> Result<u32, KernelError> {
    u32::try_from(n).map_err(|_| too_large(kernel, n))
}

/// The calls of `node`; `chunk` is `(rows, unit)` of a chunk, else the node runs whole.
#[expect(clippy::too_many_lines, reason = "one arm an operation, each a few lines; splitting would hide the table")]
pub(crate) fn lower(plan: &Plan, node: &Node, chunk: Option<(usize, usize)>) -> Result<Vec<Call>, KernelError> {
    let (graph, caps) = (&plan.graph, &plan.caps);
    let name = node.op.name();
    let n = |v: usize| u32_of(name, v);
    let rows_of = |v: Value| n(chunk.map_or_else(|| graph.shape(v).rows(), |(rows, _)| rows));
    let y = node.outputs[0];
    let one = |args: SmallVec<[Option<Value>; 8]>, dispatches: Vec<Dispatch>| Ok(vec![Call { args, dispatches }]);
    match &node.op {
        Op::Linear(l) => {
            let spec = Linear {
                m: rows_of(l.x)?,
                weights: packed_shape(graph.shape(l.w), l.form, stored_as(graph, l.w, plan.storage)),
                act: l.act,
                bias: l.bias.is_some(),
                gamma: l.gamma.is_some(),
                residual: l.residual.is_some(),
            };
            debug_assert!(
                !matches!(l.form, WeightForm::Conv | WeightForm::Winograd),
                "BUG: a linear layer with a convolution's weights"
            );
            one(smallvec![Some(l.x), Some(l.w), l.bias, l.gamma, l.residual, Some(y)], spec.record(caps)?)
        }
        Op::LayerNorm { x, weight, bias, eps, act } => {
            let c = n(graph.shape(*x).width())?;
            let spec =
                LayerNorm { m: rows_of(*x)?, c, eps: *eps, act: *act, weight: weight.is_some(), bias: bias.is_some() };
            one(smallvec![Some(*x), *weight, *bias, Some(y)], spec.record(caps)?)
        }
        Op::SplitHeads(s) => {
            let (groups, tokens) = groups(s.groups, s.tokens, chunk);
            let spec = SplitHeads {
                groups: n(groups)?,
                tokens: n(tokens)?,
                heads: n(s.heads)?,
                head_dim: n(s.head_dim)?,
                x_stride: n(graph.shape(s.x).width())?,
                x_offset: n(s.offset)?,
                norm: s.norm.map(|(_, _, eps)| eps),
                rope_rows: s.rope.map(|table| n(graph.shape(table)[0])).transpose()?,
                scale: s.scale,
                layout: s.layout,
            };
            let (weight, bias) = s.norm.map_or((None, None), |(w, b, _)| (Some(w), Some(b)));
            one(smallvec![Some(s.x), weight, bias, s.rope, Some(y)], spec.record(caps)?)
        }
        Op::Attention(a) => {
            let (groups, queries) = groups(a.groups, a.queries, chunk);
            let spec = Attention {
                groups: n(groups)?,
                heads: n(a.heads)?,
                head_dim: n(a.head_dim)?,
                nq: n(queries)?,
                nk: n(a.keys)?,
            };
            one(smallvec![Some(a.q), Some(a.k), Some(a.v), Some(y), Some(node.outputs[1])], spec.record(caps)?)
        }
        Op::Conv2d(c) => {
            let conv = algorithm::conv2d_spec(graph, c, plan.storage)?;
            let mut args = smallvec![Some(c.x), Some(c.w), c.bias, c.residuals[0], c.residuals[1], Some(y)];
            if c.form == WeightForm::Winograd {
                args.push(Some(node.outputs[1]));
                one(args, Winograd { conv }.record(caps)?)
            } else {
                one(args, conv.record(caps)?)
            }
        }
        Op::Resize { x, filter, corners, code } => {
            let (from, to) = (graph.shape(*x), graph.shape(y));
            let spec = Resize {
                frames: n(from[0])?,
                hi: n(from[1])?,
                wi: n(from[2])?,
                ho: n(to[1])?,
                wo: n(to[2])?,
                c: n(from[3])?,
                filter: *filter,
                corners: *corners,
                code: code.is_some(),
            };
            one(smallvec![Some(*x), *code, Some(y)], spec.record(caps)?)
        }
        Op::Copy { pieces } => pieces
            .iter()
            .map(|(x, piece)| Ok(Call { args: smallvec![Some(*x), Some(y)], dispatches: piece.record(caps)? }))
            .collect(),
        Op::Unary { op, x } => {
            let count = elements(plan, *x, chunk);
            let spec = Pointwise { n: n(count)?, op: PointwiseOp::Unary(*op) };
            one(smallvec![Some(*x), None, Some(y)], spec.record(caps)?)
        }
        Op::Binary { op, a, b } => {
            let count = elements(plan, *a, chunk);
            let all = graph.shape(*a).elements();
            // Operands as long as `a` are cut with it.
            let len = if b.len > 1 && b.div * b.len == all { count / b.div } else { b.len };
            let operand = Operand { div: n(b.div)?, len: n(len)? };
            let spec = Pointwise { n: n(count)?, op: PointwiseOp::Binary(*op, operand) };
            one(smallvec![Some(*a), Some(b.value), Some(y)], spec.record(caps)?)
        }
        Op::SwiGlu { x } => {
            let spec = SwiGlu { m: rows_of(*x)?, h: n(graph.shape(*x).width() / 2)? };
            one(smallvec![Some(*x), Some(y)], spec.record(caps)?)
        }
        Op::Softmax { x } => {
            let spec = Softmax { m: rows_of(*x)?, n: n(graph.shape(*x).width())? };
            one(smallvec![Some(*x), Some(y)], spec.record(caps)?)
        }
        Op::Reduce { x, op, dims: [outer, middle, inner] } => {
            let spec = Reduce { outer: n(*outer)?, n: n(*middle)?, inner: n(*inner)?, op: *op };
            one(smallvec![Some(*x), Some(y)], spec.record(caps)?)
        }
        Op::Gather { x, index } => {
            let (from, m) = (graph.shape(*x), graph.shape(*index).elements());
            let spec = Gather { n: n(from[0])?, m: n(m)?, c: n(from[1..].iter().product())? };
            one(smallvec![Some(*x), Some(*index), Some(y)], spec.record(caps)?)
        }
        Op::Scatter { base, x, index } => {
            let shape = graph.shape(*base);
            let m = graph.shape(*index).elements();
            let spec = Scatter { n: n(shape[0])?, m: n(m)?, c: n(shape[1..].iter().product())? };
            let keep = Call {
                args: smallvec![Some(*base), Some(y)],
                dispatches: whole_copy(n(shape.elements())?).record(caps)?,
            };
            let write = Call { args: smallvec![Some(*x), Some(*index), Some(y)], dispatches: spec.record(caps)? };
            Ok(vec![keep, write])
        }
        Op::TopK { x, k, flat } => {
            let shape = graph.shape(*x);
            let spec = TopK { rows: n(shape[0])?, n: n(shape[1])?, k: n(*k)?, flat: *flat };
            one(smallvec![Some(*x), Some(y), Some(node.outputs[1])], spec.record(caps)?)
        }
        Op::ReferenceView { x, strategy } => {
            let shape = graph.shape(*x);
            let spec = ReferenceView { s: n(shape[0])?, c: n(shape[1])?, strategy: *strategy };
            one(smallvec![Some(*x), Some(y), Some(node.outputs[1]), Some(node.outputs[2])], spec.record(caps)?)
        }
        Op::TokenExpand { .. }
        | Op::FieldScatter { .. }
        | Op::DeformSample(_)
        | Op::TrajApply { .. }
        | Op::Trajectory(_) => Ok(vec![motion::lower(plan, node)?]),
    }
}

/// Groups and members of one when a chunk has so many rows: whole groups, or part of the only one.
fn groups(groups: usize, members: usize, chunk: Option<(usize, usize)>) -> (usize, usize) {
    match chunk {
        None => (groups, members),
        Some((rows, _)) if groups == 1 => (1, rows),
        Some((rows, _)) => (rows / members, members),
    }
}

/// Elements of `value`, or of a chunk of its rows.
fn elements(plan: &Plan, value: Value, chunk: Option<(usize, usize)>) -> usize {
    let shape = plan.graph.shape(value);
    chunk.map_or_else(|| shape.elements(), |(rows, _)| rows * shape.width())
}

/// `n` elements as they are.
fn whole_copy(n: u32) -> StridedCopy {
    let shape = [1, 1, 1, 1, 1, n];
    let side = omnix_kernels::copy::Strided::contiguous(shape);
    StridedCopy { shape, src: side, dst: side }
}
