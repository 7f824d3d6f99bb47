//! What choosing asks of a graph, as plain lists: which node makes and reads what, in bytes and operations.

use smallvec::SmallVec;

use crate::graph::{Operation as _, Source, Value};
use crate::ops::Graph;

/// What choosing asks of a graph. Values are told apart by the one whose memory they share; what is always there (inputs, parameters,
/// constants, outputs, what is computed once) is left out.
#[derive(Clone, Debug)]
pub(super) struct Facts {
    /// The first node that every run computes.
    pub(super) first: usize,
    /// The first node of the backward pass.
    pub(super) late: usize,
    /// By node.
    pub(super) nodes: Vec<NodeFacts>,
    /// By value.
    pub(super) values: Vec<ValueFacts>,
}

/// A node.
#[derive(Clone, Debug)]
pub(super) struct NodeFacts {
    /// Values that it makes.
    pub(super) makes: SmallVec<[u32; 3]>,
    /// Values that it reads.
    pub(super) reads: SmallVec<[u32; 8]>,
    /// Its operations.
    pub(super) flops: u64,
    /// Whether it can only run once: it makes an output, or sees inputs that a node changes.
    pub(super) once: bool,
}

/// A value.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ValueFacts {
    /// Its bytes.
    pub(super) bytes: u64,
    /// The node that makes it.
    pub(super) maker: usize,
    /// The last node of the forward pass that reads it, or the one that makes it.
    pub(super) last: usize,
    /// Whether the backward pass reads it.
    pub(super) late: bool,
}

impl Facts {
    /// Of a graph whose `fixed` first nodes are computed once; none where nothing is differentiated.
    pub(super) fn of(graph: &Graph, fixed: usize) -> Option<Self> {
        let derived = |at: &usize| graph.nodes[*at].outputs.iter().any(|v| graph.derived.contains(&v.0));
        let late = (fixed..graph.nodes.len()).find(derived)?;
        let mut changed = vec![false; graph.count()];
        for value in graph.nodes.iter().flat_map(|node| node.op.writes()) {
            changed[graph.root(value).0 as usize] = true;
        }
        let mut outputs = vec![false; graph.count()];
        graph.outputs.iter().for_each(|value| outputs[graph.root(*value).0 as usize] = true);
        let mut values = vec![ValueFacts::default(); graph.count()];
        let mut nodes = Vec::with_capacity(graph.nodes.len());
        for (at, node) in graph.nodes.iter().enumerate() {
            let all_reads: SmallVec<[_; 8]> = node.op.inputs().iter().map(|value| graph.root(*value)).collect();
            let tracked = |root: &Value| {
                let maker = match graph.info(*root).source {
                    Source::Node(maker) => maker,
                    _ => return false,
                };
                maker >= fixed && !outputs[root.0 as usize]
            };
            let mut reads: SmallVec<[u32; 8]> = all_reads.iter().filter(|root| tracked(root)).map(|v| v.0).collect();
            reads.sort_unstable();
            reads.dedup();
            for read in &reads {
                let value = &mut values[*read as usize];
                if at < late {
                    value.last = at;
                } else {
                    value.late = true;
                }
            }
            let makes: SmallVec<[u32; 3]> = node.outputs.iter().filter(|root| tracked(root)).map(|v| v.0).collect();
            for made in &makes {
                let bytes = graph.info(Value(*made)).physical.bytes().max(4).next_multiple_of(256);
                values[*made as usize] = ValueFacts { bytes, maker: at, last: at, late: false };
            }
            let once = makes.len() < node.outputs.len()
                || !node.op.writes().is_empty()
                || all_reads.iter().any(|root| changed[root.0 as usize]);
            nodes.push(NodeFacts { makes, reads, flops: node.op.flops(graph, &node.outputs), once });
        }
        Some(Self { first: fixed, late, nodes, values })
    }

    /// Bytes that a node of the forward pass makes for the backward pass.
    pub(super) fn kept_bytes(&self, node: usize) -> u64 {
        let made = self.nodes[node].makes.iter().map(|value| &self.values[*value as usize]);
        made.filter(|value| value.late).map(|value| value.bytes).sum()
    }
}
