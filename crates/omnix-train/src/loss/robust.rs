//! The regression terms' sum over valid entries: errors e with confidences c, the largest left out.
//!
//! ```text
//! conf = Σ kept(λ1 e c − λ2 ln c) / n        reg = Σ kept(e) / n
//! ```
//! n is the number of all entries, or of the valid ones. kept: values are clamped to ±largest; the threshold is the value of rank
//! round_half_even(q (N − 1)), from 0, among the N valid ones; those that are strictly smaller remain, if more than a least number do,
//! else all. The two sums leave out different entries.
//!
//! Sampled entries: `counted` is 0 for valid entries that were not drawn. Their values are 0, they take part in the choice of the
//! threshold as zeros, and n is the number of those drawn (as the release does it; the golden's sampled term shows it).

use omnix_graph::ops::{Binary, Graph, ReduceOp, Unary, Which};
use omnix_graph::{GraphError, Value};

use super::config::{DivideBy, LossConfig, Trim};
use super::masked::{count, keep, keep_or_nan, keep_or_one, over, scale, visible};

/// Entries of a regression term, all of one shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entries {
    /// Errors, 0 where not valid.
    pub(super) error: Value,
    /// 1 where valid, else 0.
    pub(super) valid: Value,
    /// 1 where drawn, else 0; all valid ones without it.
    pub(super) counted: Option<Value>,
}

/// The two sums, and how many entries are valid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums {
    /// Error by confidence, and the confidence's price.
    pub(super) conf: Value,
    /// Plain error.
    pub(super) reg: Value,
    /// Valid entries.
    pub(super) entries: Value,
}

impl Entries {
    /// Both sums; `confidence` has the errors' shape and is positive where valid.
    pub(super) fn weighted(
        &self,
        graph: &mut Graph,
        confidence: Value,
        config: &LossConfig,
    ) -> Result<Sums, GraphError> {
        let confidence = keep_or_one(graph, confidence, self.valid)?;
        let product = graph.zip(Binary::Mul, self.error, confidence)?;
        let product = scale(graph, product, config.lambda1);
        let price = graph.map(Unary::Log, confidence);
        let price = scale(graph, price, config.lambda2);
        let values = graph.zip(Binary::Sub, product, price)?;
        let conf = self.sum(graph, values, config)?;
        let reg = self.plain(graph, config)?;
        let entries = count(graph, self.valid)?;
        Ok(Sums { conf, reg, entries })
    }

    /// The sum of the errors alone.
    pub(super) fn plain(&self, graph: &mut Graph, config: &LossConfig) -> Result<Value, GraphError> {
        self.sum(graph, self.error, config)
    }

    /// The sum of what is kept of `values`, divided.
    fn sum(&self, graph: &mut Graph, values: Value, config: &LossConfig) -> Result<Value, GraphError> {
        let drawn = match self.counted {
            Some(counted) => keep(graph, self.valid, counted)?,
            None => self.valid,
        };
        let values = keep(graph, values, drawn)?;
        let sum = match config.trim {
            Trim::None => graph.reduce_all(values, ReduceOp::Sum)?,
            Trim::Quantile { keep, above, largest } => {
                let clamped = graph.map(Unary::Clamp { low: -largest, high: largest }, values);
                let dropped = self.dropped(graph, clamped, keep, above)?;
                let kept = graph.zip(Binary::Drop, clamped, dropped)?;
                let sum = graph.reduce_all(kept, ReduceOp::Sum)?;
                visible(graph, sum, values)?
            }
        };
        if self.counted.is_some() || config.divide_by == DivideBy::ValidEntries {
            let n = count(graph, drawn)?;
            over(graph, sum, n)
        } else {
            let n = graph.shape(values).elements().max(1);
            Ok(scale(graph, sum, 1.0 / n as f32))
        }
    }

    /// Where `values` are not below their quantile `q`, if more than `above` are: 1, else 0.
    fn dropped(&self, graph: &mut Graph, values: Value, q: f64, above: u32) -> Result<Value, GraphError> {
        let shape = graph.shape(values).clone();
        // What is not valid has no rank.
        let ranked = keep_or_nan(graph, values, self.valid)?;
        let ranked = graph.reshape(ranked, [1, shape.elements()])?;
        let threshold = graph.rank(ranked, quantile(q))?;
        let below = graph.zip(Binary::Less, values, threshold)?;
        let dropped = graph.zip(Binary::Drop, self.valid, below)?;
        let remaining = keep(graph, below, self.valid)?;
        let remaining = count(graph, remaining)?;
        // Counts are whole numbers.
        let few = graph.map(Unary::Below { limit: above as f32 + 0.5 }, remaining);
        graph.zip(Binary::Drop, dropped, few)
    }
}

/// The quantile as kernels take it, in ten-thousandths.
fn quantile(q: f64) -> Which {
    const PARTS: u32 = 10_000;
    Which::Quantile {
        numerator: (q * f64::from(PARTS)).round().clamp(0.0, f64::from(PARTS)) as u32,
        denominator: PARTS,
    }
}
