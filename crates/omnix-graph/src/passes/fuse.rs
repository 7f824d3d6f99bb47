//! Fusion: pointwise work moves into the node that produces or reads it.
//!
//! A value is only fused away when nothing else needs it and it is no output, so tapping a value in a test turns
//! the fusion around it off. Rules:
//!
//! * an activation after a linear layer, convolution or layer norm becomes its epilogue;
//! * a product with a row vector (layer scale) after a linear layer becomes its `gamma`;
//! * an addition after a linear layer or convolution becomes its residual (a convolution takes two);
//! * a ReLU before a convolution becomes its prologue.
//!
//! Layer norm stays apart from the products that read it: a product reads each row once for every 32
//! columns, so normalising on the way in would be done 36 times over (small network) to save one pass.

use omnix_kernels::Activation;

use crate::graph::{Operation as _, Source, Value};
use crate::ops::{Binary, Graph, Map, Node, Op, Operand, Unary, Zip};

/// Applies every rule until none fits, then drops nodes that nothing needs.
#[must_use]
pub fn fuse(graph: &Graph) -> Graph {
    let mut pass = Pass { graph: graph.clone(), gone: vec![false; graph.nodes.len()], uses: uses(graph) };
    for i in 0..pass.graph.nodes.len() {
        pass.epilogue(i);
    }
    for i in 0..pass.graph.nodes.len() {
        pass.prologue(i);
    }
    prune(&pass.graph, &pass.gone)
}

/// How often each value is read (an output counts as read).
fn uses(graph: &Graph) -> Vec<u32> {
    let mut uses = vec![0; graph.count()];
    let mut add = |v: Value| uses[v.0 as usize] += 1;
    graph.nodes.iter().flat_map(|n| n.op.inputs()).for_each(&mut add);
    graph.outputs.iter().copied().for_each(&mut add);
    for (_, info) in graph.values() {
        if let Source::Reshape(inner) | Source::StraightThrough { value: inner, .. } = info.source {
            add(inner);
        }
    }
    uses
}

/// A pointwise node as seen from its producer.
#[derive(Clone, Copy)]
enum Then {
    Unary(Unary),
    Add(Operand),
    Mul(Operand),
}

struct Pass {
    graph: Graph,
    gone: Vec<bool>,
    uses: Vec<u32>,
}

impl Pass {
    /// The node that makes `value`, if this is its only use and it has not been fused away.
    fn sole_producer(&self, value: Value) -> Option<usize> {
        match self.graph.info(value).source {
            Source::Node(j) if self.uses[value.0 as usize] == 1 && !self.gone[j] => Some(j),
            _ => None,
        }
    }

    /// Node `i` is pointwise: try to make it part of its producer, which then runs in its place.
    fn epilogue(&mut self, i: usize) {
        let candidates = match self.graph.nodes[i].op {
            Op::Map(Map { op, x }) => vec![(x, Then::Unary(op))],
            // Additions commute: either side may be the producer.
            Op::Zip(Zip { op: Binary::Add, a, b }) => {
                vec![(a, Then::Add(b)), (b.value, Then::Add(Operand { value: a, ..b }))]
            }
            Op::Zip(Zip { op: Binary::Mul, a, b }) => vec![(a, Then::Mul(b))],
            _ => return,
        };
        for (value, then) in candidates {
            let Some(j) = self.sole_producer(value) else { continue };
            if let Some(fused) = self.merged(j, value, then) {
                self.graph.nodes[i].op = fused;
                self.gone[j] = true;
                return;
            }
        }
    }

    /// The operation of node `j`, which makes `value`, with `then` done in the same node, if it can be.
    fn merged(&self, j: usize, value: Value, then: Then) -> Option<Op> {
        let shape = self.graph.shape(value);
        let same = |b: &Operand| self.graph.shape(b.value) == shape && b.div == 1;
        let row = |b: &Operand| b.div == 1 && b.len == shape.width() && self.graph.shape(b.value).len() == 1;
        let mut merged = self.graph.nodes[j].op.clone();
        match (&mut merged, then) {
            (Op::Linear(l), Then::Unary(op))
                if l.act == Activation::None && l.gamma.is_none() && l.residual.is_none() =>
            {
                l.act = activation(op)?;
            }
            (Op::Conv2d(c), Then::Unary(op)) if c.act == Activation::None && c.residuals[0].is_none() => {
                c.act = activation(op)?
            }
            (Op::LayerNorm(n), Then::Unary(op)) if n.act == Activation::None => n.act = activation(op)?,
            (Op::Linear(l), Then::Mul(b)) if row(&b) && l.gamma.is_none() && l.residual.is_none() => {
                l.gamma = Some(b.value)
            }
            (Op::Linear(l), Then::Add(b)) if same(&b) && l.residual.is_none() => l.residual = Some(b.value),
            (Op::Conv2d(c), Then::Add(b)) if same(&b) => *c.residuals.iter_mut().find(|r| r.is_none())? = Some(b.value),
            _ => return None,
        }
        Some(merged)
    }

    /// Node `i` is a convolution: if it reads a ReLU, it can apply it while it reads.
    fn prologue(&mut self, i: usize) {
        let Op::Conv2d(conv) = &self.graph.nodes[i].op else { return };
        let Source::Node(j) = self.graph.info(conv.x).source else { return };
        let Op::Map(Map { op: Unary::Relu, x }) = self.graph.nodes[j].op else { return };
        if self.gone[j] || conv.relu_input {
            return;
        }
        let Op::Conv2d(conv) = &mut self.graph.nodes[i].op else { return };
        conv.x = x;
        conv.relu_input = true;
    }
}

fn activation(op: Unary) -> Option<Activation> {
    match op {
        Unary::Relu => Some(Activation::Relu),
        Unary::Gelu => Some(Activation::Gelu),
        Unary::Silu => Some(Activation::Silu),
        _ => None,
    }
}

/// The graph without the nodes in `gone` and those whose results nothing needs; values keep their numbers.
fn prune(graph: &Graph, gone: &[bool]) -> Graph {
    let mut needed = vec![false; graph.count()];
    let mark = |needed: &mut Vec<bool>, value: Value| {
        needed[value.0 as usize] = true;
        needed[graph.root(value).0 as usize] = true;
    };
    graph.outputs.iter().for_each(|v| mark(&mut needed, *v));
    let mut keep = vec![false; graph.nodes.len()];
    for (i, node) in graph.nodes.iter().enumerate().rev() {
        if !gone[i] && (node.outputs.iter().any(|v| needed[v.0 as usize]) || !node.op.writes().is_empty()) {
            keep[i] = true;
            node.op.inputs().iter().for_each(|v| mark(&mut needed, *v));
        }
    }
    let mut pruned = graph.clone();
    pruned.nodes = Vec::new();
    for (i, node) in graph.nodes.iter().enumerate().filter(|(i, _)| keep[*i]) {
        let Node { outputs, .. } = node;
        for v in outputs {
            debug_assert!(matches!(graph.info(*v).source, Source::Node(j) if j == i), "BUG: value of another node");
            pruned.values.info_mut(*v).source = Source::Node(pruned.nodes.len());
        }
        pruned.nodes.push(node.clone());
    }
    pruned
}
