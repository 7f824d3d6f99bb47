//! What the operations of the trajectory module carry.

use crate::graph::Value;

pub use omnix_kernels::traj_apply::{Gate, Motion};

/// Where the pixels of one source image sample its field and mask: see `omnix_kernels::deform_sample`.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Offsets in cells, one row a pixel: `[.., levels · points · 2]`, x then y.
    pub offsets: Value,
    /// Weights after their softmax `[.., levels · points]`, as many rows.
    pub weights: Value,
    /// The image's field `[levels, T, L, 9]`.
    pub field: Value,
    /// The image's mask, L numbers.
    pub mask: Value,
    /// Flat pixel indices, u32, one a row of offsets; without them the rows are all pixels of the image.
    pub pixels: Option<Value>,
    /// Rows and columns of the image.
    pub image: [usize; 2],
    /// Rows and columns of the grid, whose product is L.
    pub grid: [usize; 2],
}

/// Points of one source image at a range of target times, straight from its field: see `omnix_kernels::trajectory`.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory {
    /// Pixels, grid, field and mask.
    pub sampling: Sampling,
    /// World points, three numbers for each row of the offsets.
    pub points: Value,
    /// u32 `[2]`: the image's own time, and the first target time.
    pub when: Value,
    /// Target times of the range.
    pub times: usize,
    /// How points move.
    pub motion: Motion,
}

impl Sampling {
    /// Replaces every value it reads.
    pub(crate) fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        for value in [&mut self.offsets, &mut self.weights, &mut self.field, &mut self.mask] {
            *value = map(*value);
        }
        self.pixels = self.pixels.map(map);
    }
}
