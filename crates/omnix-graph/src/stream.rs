//! A plan on a device whose weights do not stay there: while one stretch of the plan runs, the weights of the next are read,
//! packed and written. At most two stretches' weights are on the device, so a network may be larger than its memory.

use std::ops::{ControlFlow, Deref, Range};

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{Caps, Gpu, WeightType};

use crate::error::GraphError;
use crate::exec::{Piece, Submissions, pieces};
use crate::graph::Graph;
use crate::plan::{Plan, weights_read};
use crate::record::{Recorded, record};
use crate::schedule::Segment;
use crate::tensors::{Bindings, Tensors};
use crate::weights::{ParameterSource, WeightKey, WeightStore};

/// Weights of about so many bytes go to the device at a time; a node whose weights are more is a stretch of its own, and so is a
/// chain that goes in chunks.
const STRETCH: u64 = 4 << 20;

/// A plan with its memory on a device, but for its weights, which pass through while it runs. For plans that run once: every
/// run reads the weights again.
#[derive(Debug)]
pub struct Streamed {
    tensors: Tensors,
    stretches: Vec<Calls>,
}

/// The kernel calls of a stretch.
#[derive(Debug)]
struct Calls {
    weights: Vec<WeightKey>,
    recorded: Vec<Recorded>,
    pieces: Vec<Piece>,
}

impl Streamed {
    /// Allocates the buffers of a plan made for passing weights ([`crate::PlanOptions::streamed`]) and makes its pipelines.
    ///
    /// # Errors
    /// As [`crate::Executable::new`].
    pub fn new(gpu: &Gpu, plan: Plan, bindings: &Bindings) -> Result<Self, GraphError> {
        debug_assert!(plan.streamed, "BUG: a plan for weights that stay");
        let mut recorded = record(&plan)?;
        for dispatch in recorded.iter().flat_map(|call| &call.dispatches) {
            gpu.prepare(dispatch)?;
        }
        let mut made = Vec::new();
        for stretch in stretches(&plan.graph, &plan.segments, plan.parts, plan.storage) {
            let rest = recorded.split_off(recorded.partition_point(|call| call.node < stretch.nodes.end));
            let recorded = std::mem::replace(&mut recorded, rest);
            made.push(Calls { weights: stretch.weights, pieces: pieces(&plan, &recorded), recorded });
        }
        Ok(Self { tensors: Tensors::new(gpu, plan, bindings)?, stretches: made })
    }

    /// Runs with the weights of `source` and waits. `progress` is told as by [`crate::Executable::run`], and when weights are written.
    ///
    /// # Errors
    /// When a weight cannot be read, memory runs out, the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    pub fn run(
        &self,
        source: &dyn ParameterSource,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<(), GraphError> {
        let mut submissions = Submissions::new(&self.tensors, progress);
        for stretch in &self.stretches {
            // The stretch before may still run. The one before that has: its weights were given back when its end was waited for.
            let gpu = self.tensors.gpu();
            let loaded = WeightStore::load(gpu, source, &stretch.weights, &mut |_, _| submissions.listen());
            let ran = loaded.and_then(|store| {
                let program = self.tensors.program(&stretch.recorded, &store)?;
                submissions.submit(&program, &stretch.pieces)
            });
            if ran.is_err() {
                submissions.finish()?;
                return ran;
            }
        }
        submissions.finish()
    }
}

/// Inputs, outputs and the plan.
impl Deref for Streamed {
    type Target = Tensors;

    fn deref(&self) -> &Tensors {
        &self.tensors
    }
}

/// Bytes of the two neighbouring stretches with the most weights, as they are uploaded.
pub(crate) fn passing_bytes(
    graph: &Graph,
    segments: &[Segment],
    parts: usize,
    storage: WeightType,
    caps: &Caps,
) -> u64 {
    let window = if caps.weight_windows() { UNIFORM_WINDOW } else { 0 };
    let uploaded = |stretch: &Stretch| if stretch.weights.is_empty() { 0 } else { stretch.bytes() + window };
    let bytes: Vec<u64> = stretches(graph, segments, parts, storage).iter().map(uploaded).collect();
    let both = |at: usize| bytes[at] + bytes.get(at + 1).unwrap_or(&0);
    (0..bytes.len()).map(both).max().unwrap_or(0)
}

/// Consecutive nodes of a plan, and the weights that they read.
struct Stretch {
    nodes: Range<usize>,
    weights: Vec<WeightKey>,
}

impl Stretch {
    fn bytes(&self) -> u64 {
        self.weights.iter().map(WeightKey::bytes).sum()
    }
}

/// The stretches of a plan whose chains go in so many parts. A weight that several read is in each of them.
fn stretches(graph: &Graph, segments: &[Segment], parts: usize, storage: WeightType) -> Vec<Stretch> {
    let mut all: Vec<Stretch> = Vec::new();
    for nodes in together(segments, parts) {
        let read = graph.nodes[nodes.clone()].iter().flat_map(|node| weights_read(graph, node, storage));
        let mut next = Stretch { nodes, weights: Vec::new() };
        for key in read {
            if !next.weights.contains(&key) {
                next.weights.push(key);
            }
        }
        match all.last_mut() {
            Some(last) if next.weights.is_empty() || last.bytes() + next.bytes() <= STRETCH => {
                last.nodes.end = next.nodes.end;
                next.weights.retain(|key| !last.weights.contains(key));
                last.weights.append(&mut next.weights);
            }
            _ => all.push(next),
        }
    }
    all
}

/// Nodes that no stretch can end between: those of a chain that goes in chunks.
fn together(segments: &[Segment], parts: usize) -> Vec<Range<usize>> {
    let of = |segment: &Segment| match segment.chain {
        Some(_) if parts > 1 => vec![segment.nodes.clone()],
        _ => segment.nodes.clone().map(|node| node..node + 1).collect(),
    };
    segments.iter().flat_map(of).collect()
}
