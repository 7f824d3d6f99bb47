//! What the spatiotemporal module is asked for, and what it gives.

use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

/// What the spatiotemporal module is asked for.
#[derive(Clone, Debug)]
pub struct MotionSpec {
    /// Images of the collection, T: sources and target times.
    pub images: usize,
    /// Patch rows and columns.
    pub grid: (usize, usize),
    /// Video and frame number of every image.
    pub times: Vec<(u32, u32)>,
    /// Whether scores are forced where the inputs [`FORCED`] say so.
    pub forced: bool,
}

impl MotionSpec {
    /// Patches of an image, L.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.grid.0 * self.grid.1
    }

    /// `PlanOptions::parts` with which nothing but the stream grows with the square of the number of images: a chunk is
    /// one target time.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.images
    }
}

/// The inputs of a graph with forced scores, `[T, L]`: where a score is forced (not 0), and to what.
pub const FORCED: [&str; 2] = ["traj.forced", "traj.forced_score"];

/// Numbers that are left out at random in training: behind each ReLU of the layers that score tokens and of those that make their gain
/// (`spec/omnix.md` section 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability with which a number is left out, from 0 to below 1; the others grow to match.
    pub share: f32,
    /// Of the whole training.
    pub seed: u64,
}

/// [`Dropout`] in a graph.
#[derive(Clone, Copy)]
pub(super) struct LeaveOut {
    dropout: Dropout,
    /// u32 `[1]`: differs between samples.
    draw: Value,
}

impl LeaveOut {
    /// Declares the input [`DRAW`].
    pub(super) fn new(g: &mut Graph, dropout: Dropout) -> Self {
        Self { dropout, draw: g.input(DRAW, [1]) }
    }

    /// Of `x`; places with another `stream` draw other numbers.
    pub(super) fn of(self, g: &mut Graph, x: Value, stream: u32) -> Result<Value, GraphError> {
        g.dropout(x, self.draw, self.dropout.share, (self.dropout.seed, stream))
    }
}

/// The input of a graph with [`Dropout`], u32 `[1]`: the same number leaves the same out.
pub const DRAW: &str = "traj.draw";

/// The recorded module; the last three are declared as outputs of the graph.
#[derive(Clone, Debug)]
pub struct MotionOutputs {
    /// The inputs `feat.0` to `feat.3` `[T, L, C]`; where tokens are made of the last feature, it alone.
    pub features: Vec<Value>,
    /// The input `traj.point_tokens` `[T, L, d]`, where tokens take points.
    pub point_tokens: Option<Value>,
    /// `field` `[T source, M, T target, L, 9]`.
    pub field: Value,
    /// `mask` `[T, L]`: 1 for tokens that were followed, else 0; or the probability, where that is what pixels sample.
    pub mask: Value,
    /// `traj.score` `[T, L]`: the probability of motion.
    pub score: Value,
}

/// Where the module's tensors are.
pub(super) fn root() -> Scope {
    Scope::root().pp("st_mod")
}
