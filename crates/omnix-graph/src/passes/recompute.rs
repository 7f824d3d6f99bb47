//! Values that are computed again instead of kept: from a differentiated graph to one that takes less memory and more operations.
//!
//! The backward pass reads many values of the forward pass long after they were made. Those that do not stay are made a second time,
//! just before the first node of the backward pass that needs them, from those that do: by copies of the nodes that made them, which are
//! the same kernels over the same numbers, so that no bit changes. The pass comes after fusion for that reason: it copies nodes as they
//! run, epilogues included, and the forward pass stays as it is. What an operation draws, it draws from a counter ([`crate::ops::Dropout`]),
//! and draws again.
//!
//! An order of nodes, with some of them twice, is all that is decided ([`order`]), and bytes and operations are counted on it. What stays
//! is chosen in [`levels`].

mod facts;
mod levels;
mod order;

use rustc_hash::FxHashMap;

pub(crate) use levels::{Level, levels};

use crate::graph::{Operation as _, Source, Value};
use crate::ops::{Graph, Node};

/// The graph in which the nodes that come twice in `order` are computed twice. What comes after the second time reads the second results.
pub(crate) fn apply(graph: &Graph, order: &[u32]) -> Graph {
    let mut nodes = Vec::with_capacity(order.len());
    let mut again = Again { graph: graph.clone(), made: FxHashMap::default() };
    let mut seen = vec![false; graph.nodes.len()];
    for at in order {
        let Node { op, outputs } = &graph.nodes[*at as usize];
        let (mut op, mut outputs) = (op.clone(), outputs.clone());
        op.map_inputs(&mut |value| again.latest(value));
        if seen[*at as usize] {
            outputs.iter_mut().for_each(|value| *value = again.copy(*value));
        }
        seen[*at as usize] = true;
        for value in &outputs {
            again.graph.values.info_mut(*value).source = Source::Node(nodes.len());
        }
        nodes.push(Node { op, outputs });
    }
    again.graph.nodes = nodes;
    again.graph
}

/// A graph on its way to one that computes some values again.
struct Again {
    graph: Graph,
    /// The second of each value that has one.
    made: FxHashMap<Value, Value>,
}

impl Again {
    /// A value like `value`, with its memory still to be said.
    fn copy(&mut self, value: Value) -> Value {
        let info = self.graph.info(value).clone();
        let copy = self.graph.add(info.name.clone(), info.shape.clone(), info.source.clone());
        *self.graph.values.info_mut(copy) = info;
        self.made.insert(value, copy);
        copy
    }

    /// What a reader of `value` reads from here on: under the shape of `value`, the second of what shares its memory where there is one.
    fn latest(&mut self, value: Value) -> Value {
        if let Some(made) = self.made.get(&value) {
            return *made;
        }
        let root = self.graph.root(value);
        let Some(made) = self.made.get(&root).copied() else { return value };
        let copy = self.copy(value);
        self.graph.values.info_mut(copy).source = Source::Reshape(made);
        copy
    }
}
