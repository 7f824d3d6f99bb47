//! Gradients of what moves numbers: every number goes back to where it came from, and is added up there where it was repeated.

use omnix_kernels::copy::{Copy as StridedCopy, Strided};

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{Copies, Graph, ReduceOp};

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
