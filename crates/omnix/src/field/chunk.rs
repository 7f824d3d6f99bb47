//! How much of an image is evaluated at a time, and the plan of that: the largest chunk whose memory fits.

use omnix_graph::ops::Motion;
use omnix_graph::{Graph, Plan, PlanOptions};
use omnix_kernels::Caps;
use omnix_model::TrajectorySpec;

use super::shape::FieldShape;
use crate::error::OmnixError;

/// How much is evaluated at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Pixels.
    pub pixels: usize,
    /// Target times.
    pub times: usize,
}

/// What an evaluation is given of its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inputs {
    /// All of it; listed pixels are gathered on the device.
    Whole,
    /// Rows of the listed pixels, and the field at the `times` target times asked for and at the image's own.
    Rows { times: usize },
}

/// The plan of an evaluation of `listed` pixels, or of all, at `times` target times.
pub(super) fn plan(
    shape: &FieldShape,
    motion: Motion,
    caps: &Caps,
    inputs: Inputs,
    listed: Option<usize>,
    times: usize,
) -> Result<Plan, OmnixError> {
    let [rows, columns] = shape.grid;
    let (all_times, gathered) = match inputs {
        Inputs::Whole => (shape.images, false),
        Inputs::Rows { times } => (times + 1, true),
    };
    let spec = TrajectorySpec {
        grid: (rows, columns),
        levels: shape.levels,
        points: shape.points,
        all_times,
        times,
        pixels: listed,
        gathered,
        motion,
    };
    let mut graph = Graph::new();
    omnix_model::trajectory(&mut graph, &spec)?;
    Ok(Plan::new(&graph, caps, &PlanOptions::default())?)
}

/// What the bytes of an evaluation depend on.
pub(super) struct Sizes<'a> {
    pub(super) shape: &'a FieldShape,
    pub(super) motion: Motion,
    pub(super) caps: &'a Caps,
    pub(super) inputs: Inputs,
    /// Whether the field is on the device.
    pub(super) resident: bool,
}

/// Positions that are read back at a time, where no budget says less.
const PIECE: u64 = 256 << 20;

impl Sizes<'_> {
    /// Bytes of a chunk: the plan's own, less what is bound to the field where that is on the device, and the staging
    /// through which positions are read back.
    fn bytes(&self, chunk: Chunk, listed: bool) -> Result<u64, OmnixError> {
        let plan = plan(self.shape, self.motion, self.caps, self.inputs, listed.then_some(chunk.pixels), chunk.times)?;
        let bound = if self.resident { self.shape.image_bytes() } else { 0 };
        Ok(plan.working_bytes().saturating_sub(bound) + (chunk.pixels * chunk.times * 12) as u64)
    }

    /// The largest chunk up to `whole` that fits, and its bytes: fewer times first, then fewer pixels.
    pub(super) fn fit(&self, whole: Chunk, listed: bool, room: Option<u64>) -> Result<(Chunk, u64), OmnixError> {
        let mut chunk = whole;
        while chunk.times > 1 && (chunk.pixels * chunk.times * 12) as u64 > PIECE {
            chunk.times = chunk.times.div_ceil(2);
        }
        loop {
            let listed = listed || chunk.pixels < whole.pixels;
            let bytes = self.bytes(chunk, listed)?;
            if room.is_none_or(|room| bytes <= room) || chunk.pixels <= LEAST {
                return Ok((chunk, bytes));
            }
            match chunk.times {
                1 => chunk.pixels = chunk.pixels.div_ceil(2).max(LEAST),
                _ => chunk.times = chunk.times.div_ceil(2),
            }
        }
    }
}

/// Fewer pixels than this at a time save no memory worth it.
const LEAST: usize = 1024;

/// The chunk in which all pixels of an image are evaluated at all times within `room`, and its bytes.
pub(crate) fn fit(
    shape: &FieldShape,
    motion: Motion,
    caps: &Caps,
    resident: bool,
    room: Option<u64>,
) -> Result<(Chunk, u64), OmnixError> {
    let whole = Chunk { pixels: shape.pixels(), times: shape.images };
    Sizes { shape, motion, caps, inputs: Inputs::Whole, resident }.fit(whole, false, room)
}

/// Bytes of the smallest chunk.
pub(crate) fn least(shape: &FieldShape, motion: Motion, caps: &Caps, resident: bool) -> Result<u64, OmnixError> {
    Ok(fit(shape, motion, caps, resident, Some(0))?.1)
}
