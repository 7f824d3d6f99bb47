//! The depth term: regression of the depth of each pixel, and of its slopes.
//!
//! With the error d = (D − D*) V of an image (V the mask) at every s-th pixel, for s = 1, 2, 4, …:
//!
//! ```text
//! slope_s = (Σ |d(x + 1) − d(x)| V V' + Σ |d(y + 1) − d(y)| V V') / Σ V
//! ```
//! V' the neighbour's mask, the sums over all images; the part is the mean over the scales.

use omnix_graph::ops::{Binary, Graph, Piece, ReduceOp, Unary};
use omnix_graph::{GraphError, Value};

use super::config::{LossConfig, Trim};
use super::masked::{Term, count, difference, dims, expect, if_enough, keep, over, scale};
use super::robust::{Entries, Sums};

/// Depth maps, all `[images, rows, columns]`.
#[derive(Clone, Copy, Debug)]
pub struct Depths {
    /// Predicted depth.
    pub prediction: Value,
    /// Predicted confidence, above 0.
    pub confidence: Value,
    /// True depth.
    pub target: Value,
    /// 1 where the true depth is known, else 0.
    pub valid: Value,
}

impl Depths {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let op = "loss.depth";
        let Self { prediction, confidence, target, valid } = *self;
        let shape: [usize; 3] = dims(graph, op, prediction, "[images, rows, columns]")?;
        for value in [confidence, target, valid] {
            expect(graph, op, value, &shape)?;
        }
        let off = difference(graph, prediction, target, valid)?;
        let error = graph.map(Unary::Abs, off);
        let entries = Entries { error, valid, counted: None };
        let Sums { conf, reg, entries } = entries.weighted(graph, confidence, config)?;
        let slope = slopes(graph, config, off, valid, shape)?;
        let least = config.least_entries;
        let conf = if_enough(graph, conf, entries, least)?;
        let reg = if_enough(graph, reg, entries, least)?;
        let slope = if_enough(graph, slope, entries, least)?;
        let value = graph.add_values(conf, reg)?;
        let weighted = scale(graph, slope, config.slope_weight);
        let value = graph.add_values(value, weighted)?;
        Ok(Term { value, entries, parts: vec![("conf", conf), ("reg", reg), ("slope", slope)] })
    }
}

/// The mean over the scales.
fn slopes(
    graph: &mut Graph,
    config: &LossConfig,
    off: Value,
    valid: Value,
    shape: [usize; 3],
) -> Result<Value, GraphError> {
    let mut sum = None;
    for scale in 0..config.slope_scales {
        let slope = Grid { shape, step: 1 << scale }.slope(graph, config, off, valid)?;
        sum = Some(match sum {
            Some(sum) => graph.add_values(sum, slope)?,
            None => slope,
        });
    }
    let sum = sum.unwrap_or_else(|| graph.fill([1], 0.0));
    Ok(scale(graph, sum, 1.0 / config.slope_scales.max(1) as f32))
}

/// Every `step`-th pixel of maps of `shape`.
#[derive(Clone, Copy)]
struct Grid {
    shape: [usize; 3],
    step: usize,
}

impl Grid {
    /// Differences between neighbours, by the number of pixels.
    fn slope(self, graph: &mut Graph, config: &LossConfig, off: Value, valid: Value) -> Result<Value, GraphError> {
        let across = self.differences(graph, config, off, valid, [0, 1])?;
        let down = self.differences(graph, config, off, valid, [1, 0])?;
        let sum = match (across, down) {
            (Some(across), Some(down)) => graph.add_values(across, down)?,
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => return Ok(graph.fill([1], 0.0)),
        };
        let pixels = self.part(graph, valid, [0, 0], [0, 0])?;
        let pixels = count(graph, pixels)?;
        over(graph, sum, pixels)
    }

    /// The sum of the differences between pixels and their neighbours at `to` (rows, columns); none where a map is one pixel wide.
    fn differences(
        self,
        graph: &mut Graph,
        config: &LossConfig,
        off: Value,
        valid: Value,
        to: [usize; 2],
    ) -> Result<Option<Value>, GraphError> {
        let [_, rows, columns] = self.shape.map(|n| n.div_ceil(self.step));
        if rows <= to[0] || columns <= to[1] {
            return Ok(None);
        }
        let [here, there] = [self.part(graph, off, [0, 0], to)?, self.part(graph, off, to, to)?];
        let [valid_here, valid_there] = [self.part(graph, valid, [0, 0], to)?, self.part(graph, valid, to, to)?];
        let both = keep(graph, valid_here, valid_there)?;
        let slope = graph.zip(Binary::Sub, there, here)?;
        let slope = graph.map(Unary::Abs, slope);
        let slope = match config.trim {
            Trim::Quantile { largest, .. } => graph.map(Unary::Clamp { low: 0.0, high: largest }, slope),
            Trim::None => slope,
        };
        let slope = keep(graph, slope, both)?;
        Ok(Some(graph.reduce_all(slope, ReduceOp::Sum)?))
    }

    /// The pixels of the grid from `start` on, without the last `less` rows and columns.
    fn part(self, graph: &mut Graph, map: Value, start: [usize; 2], less: [usize; 2]) -> Result<Value, GraphError> {
        let Self { shape: [images, rows, columns], step } = self;
        let dims = vec![images, rows.div_ceil(step) - less[0], columns.div_ceil(step) - less[1]];
        let strides = vec![rows * columns, step * columns, step];
        let start = step * (start[0] * columns + start[1]);
        let piece = Piece { value: map, dims: dims.clone(), start, strides, at: vec![0; 3] };
        graph.assemble(dims.as_slice(), &[piece])
    }
}
