//! A value's handle and its shape.

use std::fmt;
use std::ops::Deref;

use smallvec::SmallVec;

/// Dimensions, outermost first. A scalar has none.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Shape(SmallVec<[usize; 6]>);

impl Shape {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.0.iter().product()
    }

    /// Bytes of 32-bit elements.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(|d| *d as u64).product::<u64>() * 4
    }

    /// The last dimension; 1 for a scalar.
    #[must_use]
    pub fn width(&self) -> usize {
        self.0.last().copied().unwrap_or(1)
    }

    /// The shape with another last dimension; a scalar stays one.
    pub(crate) fn with_width(&self, width: usize) -> Self {
        let mut dims = self.clone();
        if let Some(last) = dims.0.last_mut() {
            *last = width;
        }
        dims
    }

    /// Product of all dimensions but the last.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.0.split_last().map_or(1, |(_, rest)| rest.iter().product())
    }
}

impl Deref for Shape {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.0
    }
}

impl<const N: usize> From<[usize; N]> for Shape {
    fn from(dims: [usize; N]) -> Self {
        Self(dims.into_iter().collect())
    }
}

impl From<&[usize]> for Shape {
    fn from(dims: &[usize]) -> Self {
        Self(dims.into())
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.0.as_slice())
    }
}

/// A handle to a value of one graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Value(pub(crate) u32);
