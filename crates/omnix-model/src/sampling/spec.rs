//! What the sampling head is asked for, and what it gives.

use omnix_graph::Value;
use omnix_weights::Scope;

/// What the sampling head is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplingSpec {
    /// Images of this chunk.
    pub frames: usize,
    /// Target times of the field.
    pub times: usize,
    /// Patch rows and columns.
    pub grid: (usize, usize),
}

/// The recorded head; the last three are declared as outputs of the graph.
#[derive(Clone, Debug)]
pub struct SamplingOutputs {
    /// The inputs `feat.0` to `feat.3` `[frames, P, C]`.
    pub features: [Value; 4],
    /// The input `field` `[frames, M, T, L, 9]`.
    pub field: Value,
    /// The input `mask` `[frames, L]`.
    pub mask: Value,
    /// `offsets` `[frames, H, W, 2 M Q]`: in cells, x then y of point q of level l at `(l · Q + q) · 2`.
    pub offsets: Value,
    /// `weights` `[frames, H, W, M Q]`, a pixel's sum to 1.
    pub weights: Value,
    /// `traj_conf` `[frames, H, W]`: at least 1, the same for all target times.
    pub confidence: Value,
}

/// Where the head's tensors are.
pub(super) fn root() -> Scope {
    Scope::root().pp("offset_head")
}
