//! The objective: `total = Σ weight · term` over the terms that a sample has targets for (`spec/omnix.md` section 11.2).
//!
//! Each term is recorded into a graph from predictions, targets and masks. Masks are f32, 1 where an entry counts and 0 elsewhere; what
//! a prediction or target is where the mask is 0 does not matter, NaN included, neither to the loss nor to its gradient. Which entries
//! are valid is data: the same recording serves all samples of a size. Every term and every part of it is an output of the graph
//! besides the total, so that each can be reported:
//!
//! | output | parts, as `term.part` |
//! |---|---|
//! | `loss.depth` | `conf`, `reg`, `slope` |
//! | `loss.ray`, `loss.trajectory` | `conf`, `reg` |
//! | `loss.camera` | `translation`, `rotation`, `fov` |
//! | `loss.score` | `pixel`, `token` |
//! | `loss.displacement` | – |
//! | `loss.total` | – |
//!
//! `conf` is the error weighted by confidence, with the confidence's price; `reg` the plain error. Terms are reported without their
//! weight in the total. `loss.TERM.entries` is the number of valid entries: below the least number, the term and its parts are 0.

mod camera;
pub mod config;
mod depth;
pub mod labels;
mod masked;
mod rays;
mod robust;
mod score;
pub mod still;
mod tracks;

use omnix_graph::ops::{Graph, Unary};
use omnix_graph::{GraphError, Value};

pub use camera::Cameras;
pub use config::{CameraError, DivideBy, LossConfig, Norm, TermWeights, Trim};
pub use depth::Depths;
pub use rays::Rays;
pub use score::{Scored, Scores};
pub use tracks::{Displacements, Tracks};

use crate::TrainError;

/// What the objective compares. A term that is absent is not recorded.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    /// Depth of every pixel.
    pub depth: Option<Depths>,
    /// Rays at the resolution of the ray head.
    pub rays: Option<Rays>,
    /// Cameras as translation, quaternion and field of view.
    pub camera: Option<Cameras>,
    /// Where every pixel's point is at every time.
    pub tracks: Option<Tracks>,
    /// How far moving points move, without the gate.
    pub displacement: Option<Displacements>,
    /// Which pixels and tokens move.
    pub score: Option<Scores>,
}

/// A recorded objective.
#[derive(Clone, Debug)]
pub struct Losses {
    /// One number, the output `loss.total`.
    pub total: Value,
    /// The names of all outputs, in the order they were recorded; the total is the last.
    pub names: Vec<String>,
}

impl Terms {
    /// Records every term that is there, and the total.
    ///
    /// # Errors
    /// [`TrainError::BadLoss`] for a configuration with numbers that cannot be, [`TrainError::NoTerms`] when there is nothing to
    /// compare, and [`TrainError::Graph`] names the first value whose shape does not fit the others.
    pub fn record(&self, graph: &mut Graph, config: &LossConfig) -> Result<Losses, TrainError> {
        config.check()?;
        let weights = config.weights;
        let mut sum = Sum { total: None, names: Vec::new() };
        if let Some(depth) = &self.depth {
            let term = depth.record(graph, config)?;
            sum.add(graph, "depth", weights.depth, &term)?;
        }
        if let Some(rays) = &self.rays {
            let term = rays.record(graph, config)?;
            sum.add(graph, "ray", weights.ray, &term)?;
        }
        if let Some(tracks) = &self.tracks {
            let term = tracks.record(graph, config)?;
            sum.add(graph, "trajectory", weights.trajectory, &term)?;
        }
        if let Some(displacement) = &self.displacement {
            let term = displacement.record(graph, config)?;
            sum.add(graph, "displacement", weights.displacement, &term)?;
        }
        if let Some(camera) = &self.camera {
            let term = camera.record(graph, config)?;
            sum.add(graph, "camera", weights.camera, &term)?;
        }
        if let Some(score) = &self.score {
            let term = score.record(graph, config)?;
            sum.add(graph, "score", weights.score, &term)?;
        }
        let Sum { total, mut names } = sum;
        let total = total.ok_or(TrainError::NoTerms)?;
        names.push("loss.total".to_owned());
        graph.output(total, "loss.total");
        Ok(Losses { total, names })
    }
}

/// The total so far, and the names of what was recorded.
struct Sum {
    total: Option<Value>,
    names: Vec<String>,
}

impl Sum {
    /// Adds `weight · term` to the total, and names the term's outputs.
    fn add(&mut self, graph: &mut Graph, name: &str, weight: f32, term: &masked::Term) -> Result<(), GraphError> {
        let mut output = |graph: &mut Graph, value: Value, name: String| {
            graph.output(value, &name);
            self.names.push(name);
        };
        for (part, value) in &term.parts {
            output(graph, *value, format!("loss.{name}.{part}"));
        }
        output(graph, term.entries, format!("loss.{name}.entries"));
        output(graph, term.value, format!("loss.{name}"));
        // Values of their own, so that no two outputs are one.
        let weighted = graph.map(Unary::ScaleShift { s: weight, t: 0.0 }, term.value);
        self.total = Some(match self.total {
            Some(total) => graph.add_values(total, weighted)?,
            None => weighted,
        });
        Ok(())
    }
}
