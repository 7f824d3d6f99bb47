//! A tensor of the checkpoint, as a graph reads it.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::value::Shape;

/// A tensor of the checkpoint, or a block of it: some leading rows (the q, k, v parts of one matrix), some columns (what
/// one of several inputs side by side is multiplied by).
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Parameter {
    /// Name as the [`crate::ParameterSource`] knows it.
    pub name: Arc<str>,
    /// Shape of the whole tensor in the checkpoint.
    pub full: Shape,
    /// Rows of its first dimension that this value stands for.
    pub rows: Range<usize>,
    /// Columns, where it does not stand for whole rows; the tensor is a matrix then.
    pub columns: Option<Range<usize>>,
    /// Stored as f32 even where the plan stores matrices as f16.
    pub keep_f32: bool,
}

impl Parameter {
    /// The shape of the block.
    #[must_use]
    pub fn shape(&self) -> Shape {
        let mut dims = self.full.to_vec();
        if let Some(first) = dims.first_mut() {
            *first = self.rows.len();
        }
        if let (Some(columns), Some(last)) = (&self.columns, dims.last_mut()) {
            *last = columns.len();
        }
        Shape::from(dims.as_slice())
    }

    /// Where the block begins in the whole tensor, and how far apart its rows are there.
    #[must_use]
    pub fn place(&self) -> (usize, usize) {
        let row: usize = self.full.get(1..).map_or(1, |rest| rest.iter().product());
        (self.rows.start * row + self.columns.as_ref().map_or(0, |columns| columns.start), row)
    }

    /// The numbers of the block, out of all of the tensor's.
    #[must_use]
    pub fn block<'a>(&self, all: &'a [f32]) -> Cow<'a, [f32]> {
        let row: usize = self.full.get(1..).map_or(1, |rest| rest.iter().product());
        let rows = &all[self.rows.start * row..self.rows.end * row];
        match &self.columns {
            None => Cow::Borrowed(rows),
            Some(columns) => rows.chunks_exact(row).flat_map(|r| &r[columns.clone()]).copied().collect(),
        }
    }

    /// The indices in the whole tensor of the block's number `at`, counted row by row.
    #[must_use]
    pub fn indices(&self, at: usize) -> Vec<usize> {
        let mut rest = at;
        let shape = self.shape();
        let mut indices: Vec<usize> = shape.iter().rev().map(|n| (rest % n, rest /= n).0).collect();
        indices.reverse();
        if let Some(first) = indices.first_mut() {
            *first += self.rows.start;
        }
        if let (Some(columns), Some(last)) = (&self.columns, indices.last_mut()) {
            *last += columns.start;
        }
        indices
    }
}
