//! The ray term: regression of the ray of each cell of the ray head, direction and origin together, by their L1 error.

use omnix_graph::ops::Graph;
use omnix_graph::{GraphError, Value};

use super::config::{LossConfig, Norm};
use super::masked::{Term, difference, dims, expect, if_enough, norm};
use super::robust::{Entries, Sums};

/// Ray maps.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Predicted rays `[images, rows, columns, 6]`: direction, origin.
    pub prediction: Value,
    /// Predicted confidence `[images, rows, columns]`, above 0.
    pub confidence: Value,
    /// True rays, as predicted ones.
    pub target: Value,
    /// 1 where the true ray is known, else 0, `[images, rows, columns]`.
    pub valid: Value,
}

impl Rays {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let op = "loss.ray";
        let Self { prediction, confidence, target, valid } = *self;
        let shape: [usize; 4] = dims(graph, op, prediction, "[images, rows, columns, 6]")?;
        expect(graph, op, target, &shape)?;
        for value in [confidence, valid] {
            expect(graph, op, value, &shape[..3])?;
        }
        let off = difference(graph, prediction, target, valid)?;
        let error = norm(graph, off, Norm::L1)?;
        let entries = Entries { error, valid, counted: None };
        let Sums { conf, reg, entries } = entries.weighted(graph, confidence, config)?;
        let conf = if_enough(graph, conf, entries, config.least_entries)?;
        let reg = if_enough(graph, reg, entries, config.least_entries)?;
        let value = graph.add_values(conf, reg)?;
        Ok(Term { value, entries, parts: vec![("conf", conf), ("reg", reg)] })
    }
}
