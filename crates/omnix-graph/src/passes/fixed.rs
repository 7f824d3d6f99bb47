//! What a plan computes from parameters and constants alone, such as the position table at the images' size: once per
//! executable, not once per run. Where weights pass through a plan runs once, and these nodes are a part of it.

use crate::graph::{Operation as _, Source};
use crate::ops::{Graph, Node};

/// Moves the nodes that no input reaches to the front, in their order; gives their number. Those that make outputs stay: the host may
/// write over an output between two runs.
pub(crate) fn to_front(graph: &mut Graph) -> usize {
    let outputs: Vec<_> = graph.outputs.iter().map(|v| graph.root(*v)).collect();
    let mut fixed = Vec::with_capacity(graph.nodes.len());
    for node in &graph.nodes {
        let inside = node.outputs.iter().all(|v| !outputs.contains(v));
        fixed.push(inside && is_fixed(graph, node, |i| fixed[i]));
    }
    let nodes = std::mem::take(&mut graph.nodes).into_iter().zip(fixed);
    let (first, others): (Vec<_>, Vec<_>) = nodes.partition(|(_, fixed)| *fixed);
    let count = first.len();
    graph.nodes = first.into_iter().chain(others).map(|(node, _)| node).collect();
    for (i, node) in graph.nodes.iter().enumerate() {
        node.outputs.iter().for_each(|v| graph.values.info_mut(*v).source = Source::Node(i));
    }
    count
}

/// Whether no input reaches `node`, when that is known of earlier ones.
fn is_fixed(graph: &Graph, node: &Node, fixed: impl Fn(usize) -> bool) -> bool {
    let inputs = node.op.inputs();
    // What reads nothing is a constant that is cheaper made again than kept.
    !inputs.is_empty()
        && inputs.into_iter().all(|value| match &graph.info(graph.root(value)).source {
            Source::Parameter(_) | Source::Constant(_) => true,
            Source::Node(i) => fixed(*i),
            Source::Input | Source::Reshape(_) | Source::StraightThrough { .. } => false,
        })
}
