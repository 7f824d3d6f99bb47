//! Gradients of what moves numbers: every number goes back to where it came from, and is added up there where it was repeated.

use omnix_kernels::copy::{Copy as StridedCopy, Strided};

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::{Source, Value};
use crate::ops::{Copies, Graph, Op, ReduceOp};

impl Rule for Copies {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dy)) = node.first() else { return Ok(()) };
        for (x, piece) in &self.pieces {
            if gradients.wants(*x) && !piece.shape.contains(&0) {
                for piece in apart(piece) {
                    let part = back(graph, dy, *x, &piece)?;
                    gradients.add(graph, *x, part)?;
                }
            }
        }
        Ok(())
    }
}

/// Pieces that together are `piece`, each of which reads every element of its source once but for axes that repeat all of it: windows
/// that overlap come apart.
fn apart(piece: &StridedCopy) -> Vec<StridedCopy> {
    let Some(axis) = overlapping(piece) else { return vec![*piece] };
    let one = |i: u32| {
        let mut one = *piece;
        one.shape[axis] = 1;
        one.src.offset += u64::from(i) * u64::from(piece.src.strides[axis]);
        one.dst.offset += u64::from(i) * u64::from(piece.dst.strides[axis]);
        one
    };
    (0..piece.shape[axis]).flat_map(|i| apart(&one(i))).collect()
}

/// The shortest of some axes that together read an element more than once.
fn overlapping(piece: &StridedCopy) -> Option<usize> {
    let stride = |axis: usize| u64::from(piece.src.strides[axis]);
    let mut axes: Vec<usize> = (0..6).filter(|axis| piece.shape[*axis] > 1 && stride(*axis) > 0).collect();
    axes.sort_by_key(|axis| stride(*axis));
    // How far all indices of the axes with shorter strides go together: a longer stride leaves that behind.
    let mut reach = 0;
    for (i, axis) in axes.iter().enumerate() {
        if stride(*axis) <= reach {
            return axes[..=i].iter().copied().min_by_key(|axis| piece.shape[*axis]);
        }
        reach += u64::from(piece.shape[*axis] - 1) * stride(*axis);
    }
    None
}

/// The part of the gradient of `x` that comes back through `piece`.
fn back(graph: &mut Graph, dy: Value, x: Value, piece: &StridedCopy) -> Result<Value, GraphError> {
    let repeated = |axis: usize| piece.src.strides[axis] == 0 && piece.shape[axis] > 1;
    let shape = graph.shape(x).clone();
    if !(0..6).any(repeated) {
        let back = StridedCopy { shape: piece.shape, src: piece.dst, dst: piece.src };
        return graph.in_zeros(shape, vec![(dy, back)]);
    }
    // The block on its own; then the sum over its repeats, last axis first; then to its place.
    let dims = piece.shape.map(|n| n as usize);
    let whole = Strided::contiguous(piece.shape);
    let mut block = graph.in_zeros(dims, vec![(dy, StridedCopy { shape: piece.shape, src: piece.dst, dst: whole })])?;
    for axis in (0..6).rev().filter(|axis| repeated(*axis)) {
        block = graph.reduce(block, ReduceOp::Sum, axis)?;
    }
    let left: [u32; 6] = std::array::from_fn(|axis| if repeated(axis) { 1 } else { piece.shape[axis] });
    graph.in_zeros(shape, vec![(block, StridedCopy { shape: left, src: Strided::contiguous(left), dst: piece.src })])
}

/// Parts of one gradient, those that are zeros but for pieces apart from each other as one: the slices of a value put together instead of
/// each in zeros of its own.
pub(super) fn joined(graph: &mut Graph, parts: &[Value]) -> Result<Vec<Value>, GraphError> {
    let mut pieces: Vec<(Value, StridedCopy)> = Vec::new();
    let (mut left, mut first, mut count) = (Vec::with_capacity(parts.len()), 0, 0);
    // Elements from one index to the next along each axis.
    let lines = parts.first().map_or(Vec::new(), |part| {
        let dims = graph.shape(*part).iter().rev();
        dims.scan(1, |line, n| Some(std::mem::replace(line, *line * *n as u64))).collect()
    });
    for part in parts {
        let more = in_zeros(graph, *part);
        let alone =
            |(_, piece): &(Value, StridedCopy)| pieces.iter().all(|(_, other)| meet_nowhere(piece, other, &lines));
        if more.is_empty() || !more.iter().all(alone) {
            left.push(*part);
            continue;
        }
        if count == 0 {
            first = left.len();
        }
        count += 1;
        pieces.extend(more);
    }
    if count < 2 {
        return Ok(parts.to_vec());
    }
    let together = graph.in_zeros(graph.shape(parts[0]).clone(), pieces)?;
    left.insert(first, together);
    Ok(left)
}

/// The pieces of a value that is zero elsewhere; none of any other value.
fn in_zeros(graph: &Graph, value: Value) -> Vec<(Value, StridedCopy)> {
    let Source::Node(node) = graph.info(graph.root(value)).source else { return Vec::new() };
    match &graph.nodes[node].op {
        Op::Copies(copies) if copies.zeros => copies.pieces.clone(),
        _ => Vec::new(),
    }
}

/// Whether two pieces surely write no element of their result both: one ends before the other begins, in the whole or within every line of
/// one of these numbers of elements.
fn meet_nowhere(a: &StridedCopy, b: &StridedCopy, lines: &[u64]) -> bool {
    // First and last element of a piece, counted from the beginning of a line by strides that are not from line to line.
    let within = |piece: &StridedCopy, line: u64| {
        let axes = piece.shape.iter().zip(&piece.dst.strides).map(|(n, stride)| (u64::from(n - 1), u64::from(*stride)));
        let reach: u64 = axes.filter(|(_, s)| !s.is_multiple_of(line)).map(|(last, stride)| last * stride).sum();
        (piece.dst.offset % line, piece.dst.offset % line + reach)
    };
    let whole = u64::MAX;
    lines.iter().filter(|line| **line > 1).chain([&whole]).any(|line| {
        let (a, b) = (within(a, *line), within(b, *line));
        a.1.max(b.1) < *line && (a.1 < b.0 || b.1 < a.0)
    })
}
