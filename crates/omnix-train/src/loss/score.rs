//! The score term: binary cross-entropy of which pixels move, and of which tokens, means over those with a label, added.
//!
//! ```text
//! −(y ln p + (1 − y) ln(1 − p)),   ln floored at −100
//! ```
//! Scores of pixels are sums that may reach 0 and 1, and are clamped to [1e-6, 1 − 1e-6] first; those of tokens only on demand.
//! [`super::labels`] makes the labels.

use omnix_graph::ops::{Binary, Graph, ReduceOp, Unary};
use omnix_graph::{GraphError, Value};

use super::config::LossConfig;
use super::masked::{Term, count, expect, if_enough, keep, over, scale, visible};

/// Scores and what they should be, all of one shape.
#[derive(Clone, Copy, Debug)]
pub struct Scored {
    /// Predicted probability of motion.
    pub probability: Value,
    /// 1 what moves, 0 what stands still.
    pub label: Value,
    /// 1 where the label is known, else 0.
    pub labelled: Value,
}

/// Scores of pixels and tokens.
#[derive(Clone, Copy, Debug)]
pub struct Scores {
    /// Pixels.
    pub pixels: Scored,
    /// Tokens.
    pub tokens: Scored,
}

/// How near to 0 and 1 a clamped probability comes.
const MARGIN: f32 = 1e-6;
/// The logarithm of 0.
const FLOOR: f32 = -100.0;

impl Scores {
    pub(super) fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Term, GraphError> {
        let entries = count(graph, self.pixels.labelled)?;
        let pixel = self.pixels.entropy(graph, true)?;
        let token = self.tokens.entropy(graph, config.clamp_token_score)?;
        let pixel = if_enough(graph, pixel, entries, config.least_entries)?;
        let token = if_enough(graph, token, entries, config.least_entries)?;
        let value = graph.add_values(pixel, token)?;
        Ok(Term { value, entries, parts: vec![("pixel", pixel), ("token", token)] })
    }
}

impl Scored {
    /// The mean over what has a label.
    fn entropy(&self, graph: &mut Graph, clamp: bool) -> Result<Value, GraphError> {
        let Self { probability, label, labelled } = *self;
        let shape = graph.shape(probability).clone();
        for value in [label, labelled] {
            expect(graph, "loss.score", value, &shape)?;
        }
        let p = keep(graph, probability, labelled)?;
        let rest = graph.map(Unary::ScaleShift { s: -1.0, t: 1.0 }, p);
        // Each is clamped on its own: 1 − (1 − MARGIN) is 5 % off in f32.
        let yes = logarithm(graph, p, clamp)?;
        let no = logarithm(graph, rest, clamp)?;
        let label = keep(graph, label, labelled)?;
        let unlabel = graph.map(Unary::ScaleShift { s: -1.0, t: 1.0 }, label);
        let yes = graph.zip(Binary::Mul, yes, label)?;
        let no = graph.zip(Binary::Mul, no, unlabel)?;
        let sum = graph.add_values(yes, no)?;
        let sum = graph.map(Unary::Neg, sum);
        let sum = keep(graph, sum, labelled)?;
        let sum = graph.reduce_all(sum, ReduceOp::Sum)?;
        let sum = visible(graph, sum, p)?;
        let n = count(graph, labelled)?;
        over(graph, sum, n)
    }
}

/// The natural logarithm of `x`, clamped first; or else [`FLOOR`] of what is below the least normal number, there without a
/// derivative.
fn logarithm(graph: &mut Graph, x: Value, clamp: bool) -> Result<Value, GraphError> {
    if clamp {
        let x = graph.map(Unary::Clamp { low: MARGIN, high: 1.0 - MARGIN }, x);
        return Ok(graph.map(Unary::Log, x));
    }
    let low = graph.map(Unary::Below { limit: f32::MIN_POSITIVE }, x);
    let safe = graph.map(Unary::Clamp { low: f32::MIN_POSITIVE, high: f32::MAX }, x);
    let log = graph.map(Unary::Log, safe);
    let log = graph.zip(Binary::Drop, log, low)?;
    let floor = scale(graph, low, FLOOR);
    graph.add_values(log, floor)
}
