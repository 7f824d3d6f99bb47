//! Which operations work row by row, so that a chain of them can run in chunks of rows.
//!
//! "Rows" are a value's leading dimensions taken together. A unit is the smallest group of rows that is
//! independent of the others: one row for a linear layer, one image's tokens for attention within images.

use smallvec::SmallVec;

use crate::graph::{Graph, Node, Value};
use crate::op::{HeadLayout, Op};

/// How a chunk of a node sees one of its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The matching part of the value.
    Rows,
    /// All of it, whichever the chunk.
    Whole,
    /// A value whose layout depends on the chunk: it must be made and used inside the chain.
    Interior,
}

/// A node that works row by row.
#[derive(Clone, Debug)]
pub struct RowWise {
    /// Rows in all.
    pub rows: usize,
    /// Rows of one independent group.
    pub unit: usize,
    /// For each of `op.inputs()`.
    pub inputs: SmallVec<[Access; 8]>,
    /// For each output.
    pub outputs: SmallVec<[Access; 3]>,
}

/// How `node` works row by row, if it does.
#[must_use]
pub fn row_wise(graph: &Graph, node: &Node) -> Option<RowWise> {
    let rows_of = |v: Value| graph.shape(v).rows();
    let mut outputs: SmallVec<[Access; 3]> = node.outputs.iter().map(|_| Access::Rows).collect();
    let with = |first: usize, rest: usize| {
        let mut inputs: SmallVec<[Access; 8]> = SmallVec::from_elem(Access::Rows, first);
        inputs.resize(first + rest, Access::Whole);
        inputs
    };
    let (rows, unit, inputs) = match &node.op {
        Op::Linear(l) => {
            let mut inputs = with(1, 1 + usize::from(l.bias.is_some()) + usize::from(l.gamma.is_some()));
            if l.residual.is_some() {
                inputs.push(Access::Rows);
            }
            (rows_of(l.x), 1, inputs)
        }
        Op::LayerNorm { x, weight, bias, .. } => {
            (rows_of(*x), 1, with(1, usize::from(weight.is_some()) + usize::from(bias.is_some())))
        }
        Op::SwiGlu { x } | Op::Softmax { x } => (rows_of(*x), 1, with(1, 0)),
        Op::Unary { x, .. } => (rows_of(*x), 1, with(1, 0)),
        Op::Binary { a, b, .. } => {
            let (rows, width) = (rows_of(*a), graph.shape(*a).width());
            if b.div * b.len == rows * width && (b.div == 1 || b.div == width) && b.len > 1 {
                (rows, 1, with(2, 0))
            } else if b.len == 1 || (b.div == 1 && b.len == width) {
                (rows, 1, with(1, 1))
            } else if b.div == 1 && b.len.is_multiple_of(width) {
                (rows, b.len / width, with(1, 1))
            } else {
                return None;
            }
        }
        Op::SplitHeads(s) if s.groups > 1 => (s.groups * s.tokens, s.tokens, with(1, node.op.inputs().len() - 1)),
        Op::SplitHeads(s) => {
            // Keys and values of one long sequence are read whole by every query, so only queries go in chunks.
            // A RoPE table that repeats every image makes the chunks whole images.
            let unit = s.rope.map_or(64, |table| graph.shape(table)[0]);
            if s.layout != HeadLayout::Rows || !s.tokens.is_multiple_of(unit) && s.rope.is_some() {
                return None;
            }
            outputs[0] = Access::Interior;
            (s.tokens, unit, with(1, node.op.inputs().len() - 1))
        }
        Op::Attention(a) => {
            outputs[1] = Access::Interior;
            if a.groups == 1 {
                // Queries made in the chain bring their own unit; with 64 here, whole images would never divide it.
                let inputs = SmallVec::from_slice(&[Access::Interior, Access::Whole, Access::Whole]);
                (a.queries, 1, inputs)
            } else {
                (a.groups * a.queries, a.queries, with(3, 0))
            }
        }
        _ => return None,
    };
    Some(RowWise { rows, unit, inputs, outputs })
}
