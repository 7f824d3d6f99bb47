//! Trajectories of one source image from its field (`spec/omnix.md` 8.2, 8.3): no weights, so it needs no network.
//!
//! Any pixels at any range of target times give the bits that all of them give. Which image and which range are data (the
//! input `when`): one recording serves all.

use omnix_graph::ops::{Motion, Sampling, Trajectory};
use omnix_graph::{Graph, GraphError, Value};

use crate::PATCH;
use crate::config::RIGID;

/// What is wanted of one source image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectorySpec {
    /// Patch rows and columns.
    pub grid: (usize, usize),
    /// Field levels, M.
    pub levels: usize,
    /// Sampling points per level, Q.
    pub points: usize,
    /// Target times of the field, T.
    pub all_times: usize,
    /// Target times of a run.
    pub times: usize,
    /// How many pixels are listed in the input `pixels`; all of the picture, row by row, without a list.
    pub pixels: Option<usize>,
    /// Whether `offsets`, `weights` and `points` have the rows of the listed pixels alone, in their order.
    pub gathered: bool,
    /// How points move: [`crate::config::TrajectoryConfig::motion`].
    pub motion: Motion,
}

/// A recorded evaluation; the last two are declared as outputs of the graph.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryOutputs {
    /// The input `offsets` `[H W, 2 M Q]`, or with the rows of the listed pixels.
    pub offsets: Value,
    /// The input `weights` `[H W, M Q]`, likewise.
    pub weights: Value,
    /// The input `field` `[M, T, L, 9]`.
    pub field: Value,
    /// The input `mask` `[L]`.
    pub mask: Value,
    /// The input `points` `[H W, 3]`, likewise.
    pub points: Value,
    /// The input `pixels`, u32 `[n]`: row · width + column.
    pub pixels: Option<Value>,
    /// The input `when`, u32 `[2]`: the image's own time, the first target time.
    pub when: Value,
    /// `trajectory` `[times, n, 3]`.
    pub trajectory: Value,
    /// `theta` `[n]`: the motion score, which may exceed 1 by a few units in the last place.
    pub theta: Value,
}

/// Records the evaluation.
///
/// # Errors
/// When a size is 0, or `times` is more than `all_times`.
pub fn trajectory(g: &mut Graph, spec: &TrajectorySpec) -> Result<TrajectoryOutputs, GraphError> {
    let TrajectorySpec { grid, levels, points, all_times, times, pixels, gathered, motion } = *spec;
    let (cells, samples) = (grid.0 * grid.1, levels * points);
    let image = [grid.0 * PATCH, grid.1 * PATCH];
    let all = match pixels {
        Some(listed) if gathered => listed,
        _ => image[0] * image[1],
    };
    let offsets = g.input("offsets", [all, 2 * samples]);
    let weights = g.input("weights", [all, samples]);
    let field = g.input("field", [levels, all_times, cells, RIGID]);
    let mask = g.input("mask", [cells]);
    let world = g.input("points", [all, 3]);
    let listed = pixels.map(|n| g.input("pixels", [n]));
    let when = g.input("when", [2]);
    let mut rows = |value: Value| match listed {
        Some(pixels) if !gathered => g.gather(value, pixels),
        _ => Ok(value),
    };
    let (offsets_of, weights_of, points_of) = (rows(offsets)?, rows(weights)?, rows(world)?);
    let sampling = Sampling {
        offsets: offsets_of,
        weights: weights_of,
        field,
        mask,
        pixels: listed,
        image,
        grid: [grid.0, grid.1],
    };
    let (moved, theta) = g.trajectory(&Trajectory { sampling, points: points_of, when, times, motion })?;
    g.output(moved, "trajectory");
    g.output(theta, "theta");
    Ok(TrajectoryOutputs {
        offsets,
        weights,
        field,
        mask,
        points: world,
        pixels: listed,
        when,
        trajectory: moved,
        theta,
    })
}
