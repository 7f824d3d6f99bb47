//! The stretches of a plan whose weights pass through the device: which nodes run with which weights there.

use std::ops::Range;

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{Caps, WeightType};

use super::schedule::Segment;
use super::weights::weights_read;
use crate::graph::WeightKey;
use crate::ops::Graph;

/// About this many bytes of weights go to the device at a time; a node whose weights are more is a stretch of its own, and so is a
/// chain that goes in chunks.
const STRETCH: u64 = 4 << 20;

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
pub(crate) struct Stretch {
    pub(crate) nodes: Range<usize>,
    pub(crate) weights: Vec<WeightKey>,
}

impl Stretch {
    fn bytes(&self) -> u64 {
        self.weights.iter().map(WeightKey::bytes).sum()
    }
}

/// The stretches of a plan whose chains go in `parts` parts. A weight that several read is in each of them.
pub(crate) fn stretches(graph: &Graph, segments: &[Segment], parts: usize, storage: WeightType) -> Vec<Stretch> {
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
