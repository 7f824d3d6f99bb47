//! Where the pixels of one source image sample its field and mask: what the operations that sample have in common, see
//! `omnix_kernels::deform_sample`. No operation of its own.

use omnix_kernels::{KernelError, deform_sample};
use smallvec::{SmallVec, smallvec};

use crate::error::{GraphError, u32_of};
use crate::graph::{Value, Values};

/// Sampling points, and what they sample.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Offsets in cells, one row per pixel: `[.., levels · points · 2]`, x then y.
    pub offsets: Value,
    /// Weights after their softmax `[.., levels · points]`, with the same number of rows.
    pub weights: Value,
    /// The image's field `[levels, T, L, 9]`.
    pub field: Value,
    /// The image's mask, L numbers.
    pub mask: Value,
    /// Flat pixel indices, u32, one per row of offsets; without them the rows are all pixels of the image.
    pub pixels: Option<Value>,
    /// Rows and columns of the image.
    pub image: [usize; 2],
    /// Rows and columns of the grid, whose product is L.
    pub grid: [usize; 2],
}

impl Sampling {
    /// Checks the shapes; the number of pixels and of times.
    pub(super) fn check(&self, values: &Values, op: &'static str) -> Result<(usize, usize), GraphError> {
        let cells = self.grid[0] * self.grid[1];
        let (levels, times) = match **values.shape(self.field) {
            [levels, times, l, 9] if l == cells && levels > 0 => (levels, times),
            _ => return Err(values.misfit(op, self.field, format!("[levels, times, {cells}, 9]"))),
        };
        let (n, taps) = (values.shape(self.weights).rows(), values.shape(self.weights).width());
        if taps == 0 || !taps.is_multiple_of(levels) {
            return Err(values.misfit(op, self.weights, format!("[n, {levels} levels x points]")));
        }
        if (values.shape(self.offsets).rows(), values.shape(self.offsets).width()) != (n, taps * 2) {
            return Err(values.misfit(op, self.offsets, format!("[{n}, {}]", taps * 2)));
        }
        if values.shape(self.mask).elements() != cells {
            return Err(values.misfit(op, self.mask, format!("[{cells}]")));
        }
        let [height, width] = self.image;
        match self.pixels.map(|pixels| (pixels, values.shape(pixels).elements())) {
            Some((pixels, count)) if count != n => Err(values.misfit(op, pixels, format!("[{n}]"))),
            None if height * width != n => {
                Err(values.misfit(op, self.weights, format!("a row for each of {width} x {height} pixels")))
            }
            _ => Ok((n, times)),
        }
    }

    /// Replaces every value it reads.
    pub(super) fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        for value in [&mut self.offsets, &mut self.weights, &mut self.field, &mut self.mask] {
            *value = map(*value);
        }
        self.pixels = self.pixels.map(map);
    }

    /// The arguments of both kernels begin alike.
    pub(super) fn args(&self) -> SmallVec<[Option<Value>; 8]> {
        smallvec![Some(self.offsets), Some(self.weights), self.pixels, Some(self.field), Some(self.mask)]
    }

    /// The kernel's view of it.
    pub(super) fn spec(&self, values: &Values) -> Result<deform_sample::DeformSample, KernelError> {
        let n = |v: usize| u32_of("deform_sample", v);
        let (field, weights) = (values.shape(self.field), values.shape(self.weights));
        Ok(deform_sample::DeformSample {
            n: n(weights.rows())?,
            width: n(self.image[1])?,
            height: n(self.image[0])?,
            hp: n(self.grid[0])?,
            wp: n(self.grid[1])?,
            levels: n(field[0])?,
            points: n(weights.width() / field[0])?,
            times: n(field[1])?,
            listed: self.pixels.is_some(),
        })
    }
}

/// The points that are moved: three numbers for each of `n` pixels.
pub(super) fn check_points(values: &Values, op: &'static str, points: Value, n: usize) -> Result<(), GraphError> {
    let shape = values.shape(points);
    if shape.width() == 3 && shape.rows() == n { Ok(()) } else { Err(values.misfit(op, points, format!("[{n}, 3]"))) }
}
