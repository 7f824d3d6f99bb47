//! Sizes of a field, part by part.

use omnix_graph::Graph;
use serde::{Deserialize, Serialize};

use crate::error::OmnixError;
use crate::request::Request;

/// Sizes of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldShape {
    /// Images, and as many target times.
    pub images: usize,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// Rows and columns of the grid.
    pub grid: [usize; 2],
    /// Levels of the field.
    pub levels: usize,
    /// Sampling points of a pixel on each level.
    pub points: usize,
}

/// What a field has of every image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// `[levels, times, cells, 9]`.
    Field,
    /// `[cells]`.
    Mask,
    /// `[height, width, levels, points, 2]`.
    Offsets,
    /// `[height, width, levels, points]`.
    Weights,
    /// `[height, width, 3]`.
    Points,
}

/// All of them, in the order of files.
pub(crate) const PARTS: [Part; 5] = [Part::Field, Part::Mask, Part::Offsets, Part::Weights, Part::Points];

impl Part {
    /// Its name as an input of the trajectory graph and in files.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Field => "field",
            Self::Mask => "mask",
            Self::Offsets => "offsets",
            Self::Weights => "weights",
            Self::Points => "points",
        }
    }
}

impl FieldShape {
    /// From the outputs of the module and of the sampling head.
    pub(crate) fn of(module: &Graph, sampling: &Graph, request: &Request) -> Result<Self, OmnixError> {
        let shape = |graph: &Graph, name: &str| graph.find(name).map(|v| graph.shape(v).to_vec());
        let missing = || OmnixError::Request { reason: "BUG: the network's motion has no field".to_owned() };
        let field = shape(module, "field").filter(|s| s.len() == 5).ok_or_else(missing)?;
        let taps = shape(sampling, "weights").and_then(|s| s.last().copied()).ok_or_else(missing)?;
        let (rows, columns) = request.grid();
        let (height, width) = (request.height, request.width);
        Ok(Self { images: field[0], height, width, grid: [rows, columns], levels: field[1], points: taps / field[1] })
    }

    /// Pixels of an image.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.height * self.width
    }

    /// Cells of the grid.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.grid[0] * self.grid[1]
    }

    /// Sizes of a part of one image.
    pub(crate) fn dims(&self, part: Part) -> Vec<usize> {
        let Self { images, height, width, levels, points, .. } = *self;
        match part {
            Part::Field => vec![levels, images, self.cells(), 9],
            Part::Mask => vec![self.cells()],
            Part::Offsets => vec![height, width, levels, points, 2],
            Part::Weights => vec![height, width, levels, points],
            Part::Points => vec![height, width, 3],
        }
    }

    /// Numbers of a part of one image.
    pub(crate) fn numbers(&self, part: Part) -> usize {
        self.dims(part).iter().product()
    }

    /// Bytes of a part of one image in a buffer of its own.
    pub(crate) fn part_bytes(&self, part: Part) -> u64 {
        (self.numbers(part) as u64 * 4).next_multiple_of(256)
    }

    /// Bytes of one image.
    #[must_use]
    pub fn image_bytes(&self) -> u64 {
        PARTS.iter().map(|part| self.part_bytes(*part)).sum()
    }

    /// Bytes of all images.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.images as u64 * self.image_bytes()
    }

    /// Bytes of one image's field and mask.
    pub(crate) fn field_bytes(&self) -> u64 {
        self.part_bytes(Part::Field) + self.part_bytes(Part::Mask)
    }

    /// Bytes of all images' fields and masks.
    pub(crate) fn all_fields(&self) -> u64 {
        self.images as u64 * self.field_bytes()
    }

    /// Bytes of all images' points.
    pub(crate) fn all_points(&self) -> u64 {
        self.images as u64 * self.part_bytes(Part::Points)
    }

    /// Operations of evaluating one image's pixels at all times.
    pub(crate) fn evaluation_flops(&self) -> u64 {
        let (pixels, times) = (self.pixels() as u64, self.images as u64);
        8 * pixels * (self.levels * self.points) as u64 * (9 * (times + 1) + 1) + 90 * pixels * times
    }
}
