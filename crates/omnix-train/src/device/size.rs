//! The shape of samples.

use omnix_model::PATCH;

/// The shape of all samples of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Images.
    pub images: usize,
    /// Rows and columns of patches.
    pub grid: (usize, usize),
}

impl Size {
    /// Rows and columns of pixels.
    #[must_use]
    pub fn pixels(&self) -> [usize; 2] {
        [self.grid.0 * PATCH, self.grid.1 * PATCH]
    }
}
