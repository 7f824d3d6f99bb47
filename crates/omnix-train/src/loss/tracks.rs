//! The trajectory term, and the term on displacements that starts motion in a network trained from nothing.
//!
//! Trajectory: regression of where the point of each pixel is at each time. An entry is a pixel and a time; the confidence is that of
//! the source pixel at all times. With `counted` only drawn entries count ([`super::still`] draws them).
//!
//! Displacement, of pixels that move, from points that no gate holds back:
//!
//! ```text
//! Σ |(P̂(t) − P̂(own)) − (P(t) − P(own))| / n
//! ```
//! n the number of valid entries. Unlike the trajectory term it depends neither on the gate, which gives a field no gradient while it
//! is closed, nor on where the geometry puts the point.

use omnix_graph::ops::{Binary, Graph, Piece};
use omnix_graph::{GraphError, Value};

use super::config::{DivideBy, LossConfig};
use super::masked::{Term, count, difference, dims, expect, if_enough, norm};
use super::robust::{Entries, Sums};

/// Points at all times: `[images, times, pixels, 3]`.
#[derive(Clone, Copy, Debug)]
pub struct Tracks {
    /// Predicted points.
    pub prediction: Value,
    /// Predicted confidence of each source pixel, above 0: `[images, pixels]`.
    pub confidence: Value,
    /// True points.
    pub target: Value,
    /// 1 where the true point is known, else 0: `[images, times, pixels]`.
    pub valid: Value,
    /// 1 where an entry was drawn, else 0, in the same shape; all valid ones count without it.
    pub counted: Option<Value>,
}

impl Tracks {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let op = "loss.trajectory";
        let Self { prediction, confidence, target, valid, counted } = *self;
        let shape: [usize; 4] = dims(graph, op, prediction, "[images, times, pixels, 3]")?;
        let [images, times, pixels, _] = shape;
        expect(graph, op, target, &shape)?;
        for value in [Some(valid), counted].into_iter().flatten() {
            expect(graph, op, value, &shape[..3])?;
        }
        expect(graph, op, confidence, &[images, pixels])?;
        let off = difference(graph, prediction, target, valid)?;
        let error = norm(graph, off, config.track_norm)?;
        let everywhere = Piece {
            value: confidence,
            dims: shape[..3].to_vec(),
            start: 0,
            strides: vec![pixels, 0, 1],
            at: vec![0; 3],
        };
        let confidence = graph.assemble([images, times, pixels], &[everywhere])?;
        let entries = Entries { error, valid, counted };
        let Sums { conf, reg, entries } = entries.weighted(graph, confidence, config)?;
        let conf = if_enough(graph, conf, entries, config.least_entries)?;
        let reg = if_enough(graph, reg, entries, config.least_entries)?;
        let value = graph.add_values(conf, reg)?;
        Ok(Term { value, entries, parts: vec![("conf", conf), ("reg", reg)] })
    }
}

/// Points at all times without a gate: `[images, times, pixels, 3]`.
#[derive(Clone, Debug)]
pub struct Displacements {
    /// Predicted points, moved whatever their score.
    pub prediction: Value,
    /// True points.
    pub target: Value,
    /// 1 where a pixel moves and its true point is known at this time and at its own, else 0: `[images, times, pixels]`.
    pub valid: Value,
    /// Which of the times is each image's own.
    pub own: Vec<usize>,
}

impl Displacements {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let op = "loss.displacement";
        let shape: [usize; 4] = dims(graph, op, self.prediction, "[images, times, pixels, 3]")?;
        let [images, times, ..] = shape;
        expect(graph, op, self.target, &shape)?;
        expect(graph, op, self.valid, &shape[..3])?;
        if self.own.len() != images || self.own.iter().any(|own| *own >= times) {
            let reason = format!("own times {:?}; one below {times} is needed for each of {images} images", self.own);
            return Err(GraphError::Arguments { op, reason });
        }
        let prediction = self.displacement(graph, self.prediction, shape)?;
        let target = self.displacement(graph, self.target, shape)?;
        let off = difference(graph, prediction, target, self.valid)?;
        let error = norm(graph, off, config.track_norm)?;
        let of_valid = config.clone().divide_by(DivideBy::ValidEntries);
        let value = Entries { error, valid: self.valid, counted: None }.plain(graph, &of_valid)?;
        let entries = count(graph, self.valid)?;
        let value = if_enough(graph, value, entries, config.least_entries)?;
        Ok(Term { value, entries, parts: Vec::new() })
    }

    /// `points(t) − points(own)`.
    fn displacement(&self, graph: &mut Graph, points: Value, shape: [usize; 4]) -> Result<Value, GraphError> {
        let [_, times, pixels, axes] = shape;
        let image = |(source, own): (usize, &usize)| Piece {
            value: points,
            dims: vec![1, times, pixels, axes],
            start: (source * times + own) * pixels * axes,
            strides: vec![0, 0, axes, 1],
            at: vec![source, 0, 0, 0],
        };
        let own: Vec<Piece> = self.own.iter().enumerate().map(image).collect();
        let own = graph.assemble(shape, &own)?;
        graph.zip(Binary::Sub, points, own)
    }
}
