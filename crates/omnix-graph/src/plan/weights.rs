//! The parameters that a plan reads, in the form they are stored.

use omnix_kernels::WeightType;

use crate::graph::{Operation as _, Source, Value, WeightKey};
use crate::ops::{Graph, Node};

/// The form in which each parameter is read, in order of first use.
pub(crate) fn weights(graph: &Graph, storage: WeightType) -> Vec<WeightKey> {
    let mut seen = rustc_hash::FxHashSet::default();
    let mut keys = Vec::new();
    for node in &graph.nodes {
        for key in weights_read(graph, node, storage) {
            if seen.insert(key.clone()) {
                keys.push(key);
            }
        }
    }
    keys
}

/// The weights that `node` reads.
pub(crate) fn weights_read(graph: &Graph, node: &Node, storage: WeightType) -> impl Iterator<Item = WeightKey> {
    node.op.inputs().into_iter().filter_map(move |value| weight_key(graph, node, value, storage))
}

/// The key under which `value`, read by `node`, is stored.
pub(crate) fn weight_key(graph: &Graph, node: &Node, value: Value, storage: WeightType) -> Option<WeightKey> {
    let Source::Parameter(parameter) = &graph.info(graph.root(value)).source else { return None };
    Some(WeightKey { parameter: parameter.clone(), packing: node.op.packing(graph, value, storage) })
}
