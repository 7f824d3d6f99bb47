//! What is asked of a field, and what comes back.

use std::ops::Range;

use omnix_kernels::BufferSlice;

use super::chunk::Chunk;
use super::shape::FieldShape;
use crate::error::OmnixError;

/// Which pixels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// All, row by row.
    All,
    /// These columns and rows, in this order.
    List(Vec<[u32; 2]>),
    /// Those where the mask (one value per pixel, row by row) is true, row by row.
    Mask(Vec<bool>),
    /// Every n-th column and row, from the first.
    Stride(usize),
}

/// What is to be evaluated: [`Query::new`], then its setters.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Query {
    /// The source image.
    pub image: usize,
    /// Its pixels.
    pub pixels: Pixels,
    /// Target times.
    pub times: Range<usize>,
    /// At most so much at a time; `None` lets the budget decide.
    pub chunk: Option<Chunk>,
}

impl Query {
    /// Pixels of an image at these times.
    #[must_use]
    pub fn new(image: usize, pixels: Pixels, times: Range<usize>) -> Self {
        Self { image, pixels, times, chunk: None }
    }

    /// At most so much at a time.
    #[must_use]
    pub fn chunk(mut self, chunk: Chunk) -> Self {
        self.chunk = Some(chunk);
        self
    }
}

/// Evaluated trajectories.
#[derive(Clone, Debug, PartialEq)]
pub struct Paths {
    /// The target times.
    pub times: Range<usize>,
    /// Flat indices (row · width + column) of the pixels; `None` for all of them.
    pub pixels: Option<Vec<u32>>,
    /// `[times][pixels][3]`: world positions in the network's scale.
    pub positions: Vec<f32>,
    /// `[pixels]`: motion score θ.
    pub theta: Vec<f32>,
}

/// A piece of trajectories, as they stream.
#[derive(Clone, Copy, Debug)]
pub struct PathPiece<'a> {
    /// The first of its target times.
    pub first_time: usize,
    /// Number of its target times.
    pub times: usize,
    /// The first of its pixels, counted among those asked for.
    pub first_pixel: usize,
    /// `[times][pixels of the piece][3]`.
    pub positions: &'a [f32],
    /// `[pixels of the piece]`.
    pub theta: &'a [f32],
}

/// Trajectories on the device: f32, row-major, storage buffers that can also be copied from.
#[derive(Clone, Debug)]
pub struct ResidentPaths {
    /// `[times, pixels, 3]`.
    pub positions: BufferSlice,
    /// `[pixels]`.
    pub theta: BufferSlice,
}

impl Pixels {
    /// Flat indices of the pixels, `None` for all.
    pub(crate) fn resolve(&self, shape: &FieldShape) -> Result<Option<Vec<u32>>, OmnixError> {
        let (width, height) = (shape.width, shape.height);
        let wrong = |reason: String| OmnixError::Query { reason };
        match self {
            Self::All => Ok(None),
            Self::List(list) => {
                if let Some([x, y]) = list.iter().find(|[x, y]| *x as usize >= width || *y as usize >= height) {
                    let (right, bottom) = (width - 1, height - 1);
                    return Err(wrong(format!(
                        "pixel {x},{y} lies outside the image: columns go from 0 to {right}, rows from 0 to {bottom}"
                    )));
                }
                Ok(Some(list.iter().map(|[x, y]| y * width as u32 + x).collect()))
            }
            Self::Mask(mask) if mask.len() != width * height => {
                let pixels = mask.len();
                Err(wrong(format!("a mask of {pixels} pixels: images of this field have {width}x{height}")))
            }
            Self::Mask(mask) => Ok(Some((0..).zip(mask).filter(|(_, on)| **on).map(|(i, _)| i).collect())),
            Self::Stride(0) => Err(wrong("a stride of 0: 1 is every pixel".to_owned())),
            Self::Stride(1) => Ok(None),
            Self::Stride(step) => {
                let row = |y: usize| (0..width).step_by(*step).map(move |x| (y * width + x) as u32);
                Ok(Some((0..height).step_by(*step).flat_map(row).collect()))
            }
        }
    }
}
