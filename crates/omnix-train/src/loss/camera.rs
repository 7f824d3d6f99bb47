//! The camera term: `w0 · mean |t − t*| + w1 · mean |q − q*| + w2 · mean |f − f*|`, or Huber errors in place of absolute ones.
//!
//! Translation t (3), quaternion q (4) as predicted, field of view f (2). The true quaternion has w ≥ 0. Means are over the valid numbers
//! of a group, so that a data set without intrinsics leaves out the field of view alone.

use omnix_graph::ops::{Binary, Graph, ReduceOp, Unary};
use omnix_graph::{GraphError, Value};

use super::config::{CameraError, LossConfig};
use super::masked::{Term, count, difference, dims, expect, if_enough, over, scale};

/// Cameras: `[images, 9]`, translation, quaternion, field of view.
#[derive(Clone, Copy, Debug)]
pub struct Cameras {
    /// Predicted cameras.
    pub prediction: Value,
    /// True cameras.
    pub target: Value,
    /// 1 where a number is known, else 0: `[images, 9]`.
    pub valid: Value,
    /// The first image's mask of valid pixels, of any shape: the scale of the scene comes from it, and without enough of them (more
    /// than the least number of entries) the term is 0.
    pub first_image: Option<Value>,
}

/// Names and columns of the groups.
const GROUPS: [(&str, usize, usize); 3] = [("translation", 0, 3), ("rotation", 3, 4), ("fov", 7, 2)];

impl Cameras {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let op = "loss.camera";
        let Self { prediction, target, valid, first_image } = *self;
        let [images, _]: [usize; 2] = dims(graph, op, prediction, "[images, 9]")?;
        for value in [prediction, target, valid] {
            expect(graph, op, value, &[images, 9])?;
        }
        let off = difference(graph, prediction, target, valid)?;
        let size = graph.map(Unary::Abs, off);
        let error = match config.camera {
            CameraError::L1 => size,
            // With m = min(|e|, delta): m (|e| − m / 2).
            CameraError::Huber { delta } => {
                let short = graph.map(Unary::Clamp { low: 0.0, high: delta }, size);
                let half = scale(graph, short, 0.5);
                let rest = graph.zip(Binary::Sub, size, half)?;
                graph.zip(Binary::Mul, short, rest)?
            }
        };
        let pixels = match first_image {
            Some(mask) => Some(count(graph, mask)?),
            None => None,
        };
        let mut parts = Vec::with_capacity(GROUPS.len());
        let mut value = None;
        for ((name, start, len), weight) in GROUPS.into_iter().zip(config.camera_weights) {
            let errors = graph.slice(error, 1, start, len)?;
            let sum = graph.reduce_all(errors, ReduceOp::Sum)?;
            let known = graph.slice(valid, 1, start, len)?;
            let known = count(graph, known)?;
            let mut part = over(graph, sum, known)?;
            if let Some(pixels) = pixels {
                part = if_enough(graph, part, pixels, config.least_entries.saturating_add(1))?;
            }
            parts.push((name, part));
            let weighted = scale(graph, part, weight);
            value = Some(match value {
                Some(value) => graph.add_values(value, weighted)?,
                None => weighted,
            });
        }
        let value = value.unwrap_or(error);
        let entries = count(graph, valid)?;
        Ok(Term { value, entries, parts })
    }
}
