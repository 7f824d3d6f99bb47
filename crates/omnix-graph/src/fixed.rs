//! What a plan computes from parameters and constants alone, such as the position table at the images' size: once an
//! [`crate::Executable`], not once a run.

use crate::graph::{Graph, Node, Source};

/// Moves the nodes that no input reaches to the front, in their order.
pub(crate) fn to_front(graph: &mut Graph) {
    let mut fixed = Vec::with_capacity(graph.nodes.len());
    for node in &graph.nodes {
        fixed.push(is_fixed(graph, node, |i| fixed[i]));
    }
    let nodes = std::mem::take(&mut graph.nodes).into_iter().zip(fixed);
    let (first, others): (Vec<_>, Vec<_>) = nodes.partition(|(_, fixed)| *fixed);
    graph.nodes = first.into_iter().chain(others).map(|(node, _)| node).collect();
    for (i, node) in graph.nodes.iter().enumerate() {
        node.outputs.iter().for_each(|v| graph.values[v.0 as usize].source = Source::Node(i));
    }
}

/// How many nodes at the front no input reaches.
pub(crate) fn leading(graph: &Graph) -> usize {
    let mut count = 0;
    while graph.nodes.get(count).is_some_and(|node| is_fixed(graph, node, |i| i < count)) {
        count += 1;
    }
    count
}

/// Whether no input reaches `node`, when that is known of earlier ones.
fn is_fixed(graph: &Graph, node: &Node, fixed: impl Fn(usize) -> bool) -> bool {
    node.op.inputs().into_iter().all(|value| match &graph.info(graph.root(value)).source {
        Source::Parameter(_) | Source::Constant(_) => true,
        Source::Node(i) => fixed(*i),
        Source::Input | Source::Reshape(_) => false,
    })
}
