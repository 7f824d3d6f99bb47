//! A plan: fused graph, chains, chunk sizes, buffers. Everything is known here before a device is touched.

mod fit;
pub mod memory;
pub mod options;
pub(crate) mod record;
mod repeat;
pub mod schedule;
pub(crate) mod stretch;
pub(crate) mod weights;
pub mod work;

use omnix_kernels::{Caps, WeightType};

pub use options::PlanOptions;

use crate::error::GraphError;
use crate::graph::{Operation as _, Value, WeightKey};
use crate::ops::Graph;
use crate::passes::fuse::fuse;
use crate::passes::{algorithm, fixed};
use fit::Fit;
use memory::{MemoryPlan, Place};
use repeat::{Fitted, fit_repeating};
use schedule::Segment;
use stretch::passing_bytes;

/// A graph made ready for one kind of device: made once for a shape, run many times.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Plan {
    /// The fused graph.
    pub graph: Graph,
    /// Number of leading nodes that depend only on parameters and constants. They are computed once, when the executable is made;
    /// 0 where weights pass through.
    pub fixed: usize,
    /// Its nodes in chains.
    pub segments: Vec<Segment>,
    /// About how many parts each chain goes in.
    pub parts: usize,
    /// Buffers.
    pub memory: MemoryPlan,
    /// The device's facts.
    pub caps: Caps,
    /// Whether weights pass through (`Streamed`).
    pub streamed: bool,
    /// How matrices are stored.
    pub storage: WeightType,
    /// The parameters in the form they are stored, in order of first use.
    pub weights: Vec<WeightKey>,
    /// Floating-point operations of a run that compute values again instead of keeping them; part of [`Plan::flops`].
    pub recomputed: u64,
}

impl Plan {
    /// Plans `graph` for a device with `caps`.
    ///
    /// # Errors
    /// [`GraphError::Budget`] with the least that works, or [`GraphError::TensorTooLarge`].
    pub fn new(graph: &Graph, caps: &Caps, options: &PlanOptions) -> Result<Self, GraphError> {
        let mut graph = if options.fuse { fuse(graph) } else { graph.clone() };
        algorithm::choose(&mut graph, caps, options.storage);
        let fixed = if options.streamed { 0 } else { fixed::to_front(&mut graph) };
        let Fitted { graph, fit, flops: recomputed } = fit_repeating(graph, fixed, caps, options)?;
        let Fit { segments, parts, memory, .. } = fit;
        let weights = weights::weights(&graph, options.storage);
        // Operands are as good as the weights.
        let caps = caps.clone().with_f16(caps.f16 && options.storage != WeightType::F32);
        let PlanOptions { streamed, storage, .. } = *options;
        Ok(Self { graph, fixed, segments, parts, memory, caps, streamed, storage, weights, recomputed })
    }

    /// Bytes of the weights.
    #[must_use]
    pub fn weight_bytes(&self) -> u64 {
        self.weights.iter().map(WeightKey::bytes).sum()
    }

    /// Bytes of weights on the device while the plan runs: all, or where they pass through those of two stretches. On devices that
    /// weights are copied to, the copy's source is not counted.
    #[must_use]
    pub fn resident_weight_bytes(&self) -> u64 {
        if self.streamed {
            passing_bytes(&self.graph, &self.segments, self.parts, self.storage, &self.caps)
        } else {
            self.weight_bytes()
        }
    }

    /// Bytes of everything but the weights while the plan runs.
    #[must_use]
    pub fn working_bytes(&self) -> u64 {
        self.memory.total()
    }

    /// Floating-point operations of a run (a multiply-add is two).
    #[must_use]
    pub fn flops(&self) -> u64 {
        (self.fixed..self.graph.nodes.len()).map(|i| node_flops(&self.graph, i)).sum()
    }

    /// The part of [`Plan::flops`] that linear layers and convolutions have: what is left without attention and everything small.
    #[must_use]
    pub fn layer_flops(&self) -> u64 {
        let layers = (self.fixed..self.graph.nodes.len())
            .filter(|i| matches!(self.graph.nodes[*i].op.name(), "linear" | "conv2d"));
        layers.map(|i| node_flops(&self.graph, i)).sum()
    }

    /// Rows of the largest chunk of each chain, for reports: `(first node's name, rows, rows of a chunk)`.
    #[must_use]
    pub fn chunks(&self) -> Vec<(String, usize, usize)> {
        let chains = self.segments.iter().filter_map(|s| Some((s, s.chain.as_ref()?)));
        chains
            .map(|(s, chain)| {
                let first = &self.graph.nodes[s.nodes.start];
                (self.graph.value_name(first.outputs[0]).to_owned(), chain.rows, chain.chunk_rows(self.parts))
            })
            .collect()
    }

    /// Bytes of the memory that `value` lives in, as stored; 0 where nothing reads it.
    #[must_use]
    pub fn bytes(&self, value: Value) -> u64 {
        self.memory.bytes[self.graph.root(value).0 as usize]
    }

    /// Where `value` lives.
    #[must_use]
    pub fn place(&self, value: Value) -> Place {
        self.memory.places[self.graph.root(value).0 as usize]
    }
}

/// Floating-point operations of node `index`; what only moves numbers counts none.
#[must_use]
pub fn node_flops(graph: &Graph, index: usize) -> u64 {
    let node = &graph.nodes[index];
    node.op.flops(graph, &node.outputs)
}
