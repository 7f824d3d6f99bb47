//! How an operation works row by row, so that a chain of operations can run in chunks of rows.
//!
//! "Rows" are a value's leading dimensions taken together. A unit is the smallest group of rows that is
//! independent of the others: one row for a linear layer, one image's tokens for attention within images.

use smallvec::{SmallVec, smallvec};

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
    /// Number of rows.
    pub rows: usize,
    /// Rows of one independent group.
    pub unit: usize,
    /// For each of the operation's inputs.
    pub inputs: SmallVec<[Access; 8]>,
    /// For each output.
    pub outputs: SmallVec<[Access; 3]>,
}

impl RowWise {
    /// One output in rows; the first `by_row` inputs alike, the `whole` others seen whole.
    #[must_use]
    pub fn new(rows: usize, unit: usize, by_row: usize, whole: usize) -> Self {
        let mut inputs: SmallVec<[Access; 8]> = SmallVec::from_elem(Access::Rows, by_row);
        inputs.resize(by_row + whole, Access::Whole);
        Self { rows, unit, inputs, outputs: smallvec![Access::Rows] }
    }
}
