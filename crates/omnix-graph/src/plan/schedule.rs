//! Chains: runs of row-wise nodes that go through memory chunk by chunk.
//!
//! Inside a chain, values that nothing outside needs (a feed-forward layer's hidden rows, the queries of a
//! sequence) exist for one chunk at a time. Rows do not see each other, so chunk sizes change no bit.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::{Access, Operation as _, RowWise, Source, Value};
use crate::ops::{Graph, Node};

/// Consecutive nodes that run together.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Indices of the nodes.
    pub nodes: Range<usize>,
    /// How they may be cut into chunks; `None` if they run whole.
    pub chain: Option<Chain>,
}

/// What the nodes of a chain share.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Rows in all.
    pub rows: usize,
    /// Chunks start at multiples of this.
    pub unit: usize,
    /// For each node of the segment.
    pub row_wise: Vec<RowWise>,
    /// Roots of the values that live for one chunk.
    pub interior: Vec<Value>,
}

impl Chain {
    /// Rows of a chunk when the rows go in about `parts` parts.
    #[must_use]
    pub fn chunk_rows(&self, parts: usize) -> usize {
        let units = self.rows.div_ceil(self.unit);
        (units.div_ceil(parts) * self.unit).min(self.rows)
    }
}

/// Cuts the nodes of `graph` into segments; every offset of a chunk is a multiple of `align` bytes. The `fixed` first nodes are no
/// part of a chain. A `short` chain ends where the fewest bytes go on, since it needs all its weights at once.
#[must_use]
pub fn segments(graph: &Graph, fixed: usize, align: u64, short: bool) -> Vec<Segment> {
    let last_use = last_uses(graph);
    let mut out: Vec<Segment> = (0..fixed).map(|at| Segment { nodes: at..at + 1, chain: None }).collect();
    let mut at = fixed;
    while at < graph.nodes.len() {
        let mut end = at;
        let mut row_wise_nodes: Vec<RowWise> = Vec::new();
        while let Some(row_wise) = graph.nodes.get(end).and_then(|n| row_wise(graph, n)) {
            if !fits(graph, at..end, row_wise_nodes.first(), end, &row_wise) {
                break;
            }
            row_wise_nodes.push(row_wise);
            end += 1;
        }
        // A chunk-shaped value that is still needed later ends the chain before it is made.
        let escapes = |end: usize| {
            (at..end).find(|i| {
                graph.nodes[*i]
                    .outputs
                    .iter()
                    .zip(&row_wise_nodes[*i - at].outputs)
                    .any(|(v, access)| *access == Access::Interior && last_use[graph.root(*v).0 as usize] >= end)
            })
        };
        while let Some(i) = escapes(end) {
            end = i;
        }
        if short {
            let ends = (at + 1..=end).filter(|end| escapes(*end).is_none());
            end = ends.min_by_key(|end| bytes_alive(graph, at..*end, &last_use)).unwrap_or(end);
        }
        row_wise_nodes.truncate(end - at);
        let nodes = at..end.max(at + 1);
        let chain = (end > at).then(|| chain(graph, &nodes, row_wise_nodes, &last_use, align)).flatten();
        at = nodes.end;
        out.push(Segment { nodes, chain });
    }
    out
}

/// How `node` works row by row, if it does, and if it sees all values of one root alike: a chunk has one window for each root.
fn row_wise(graph: &Graph, node: &Node) -> Option<RowWise> {
    let mut row_wise = node.op.row_wise(graph)?;
    row_wise.outputs.resize(node.outputs.len(), Access::Rows);
    let seen: Vec<(Value, Access)> = node
        .op
        .inputs()
        .iter()
        .zip(&row_wise.inputs)
        .chain(node.outputs.iter().zip(&row_wise.outputs))
        .map(|(v, access)| (graph.root(*v), *access))
        .collect();
    let alike = seen.iter().all(|(root, access)| seen.iter().all(|(other, a)| other != root || a == access));
    alike.then_some(row_wise)
}

/// Bytes of what `nodes` make and later nodes read, whole.
fn bytes_alive(graph: &Graph, nodes: Range<usize>, last_use: &[usize]) -> u64 {
    let made = graph.nodes[nodes.clone()].iter().flat_map(|node| &node.outputs).map(|v| graph.root(*v));
    let alive: BTreeSet<Value> = made.filter(|root| last_use[root.0 as usize] >= nodes.end).collect();
    alive.iter().map(|root| graph.info(*root).physical.bytes()).sum()
}

/// Whether node `index` can join the chain `nodes`.
fn fits(graph: &Graph, nodes: Range<usize>, first: Option<&RowWise>, index: usize, row_wise: &RowWise) -> bool {
    let same_rows = first.is_none_or(|f| f.rows == row_wise.rows);
    let made_here = |v: Value| matches!(graph.info(graph.root(v)).source, Source::Node(j) if nodes.contains(&j));
    let inputs = graph.nodes[index].op.inputs();
    same_rows
        && inputs.iter().zip(&row_wise.inputs).all(|(v, access)| match access {
            Access::Rows => true,
            Access::Whole => !made_here(*v),
            Access::Interior => made_here(*v),
        })
}

/// Index of the last node that reads each root; outputs are never done with.
pub(crate) fn last_uses(graph: &Graph) -> Vec<usize> {
    let mut last = vec![0; graph.count()];
    for (i, node) in graph.nodes.iter().enumerate() {
        for v in node.op.inputs() {
            last[graph.root(v).0 as usize] = i;
        }
    }
    for v in &graph.outputs {
        last[graph.root(*v).0 as usize] = usize::MAX;
    }
    last
}

fn chain(graph: &Graph, nodes: &Range<usize>, row_wise: Vec<RowWise>, last_use: &[usize], align: u64) -> Option<Chain> {
    let rows = row_wise[0].rows;
    let mut interior = Vec::new();
    let mut unit = row_wise.iter().fold(1, |unit, r| lcm(unit, r.unit));
    for (node, access) in graph.nodes[nodes.clone()].iter().zip(&row_wise) {
        for v in &node.outputs {
            let root = graph.root(*v);
            if last_use[root.0 as usize] < nodes.end && !interior.contains(&root) {
                interior.push(root);
            }
        }
        let inputs = node.op.inputs();
        let seen = inputs.iter().zip(&access.inputs).chain(node.outputs.iter().zip(&access.outputs));
        for (v, _) in seen.filter(|(_, access)| **access == Access::Rows) {
            // Bytes of `unit` rows of this value must keep windows aligned.
            let bytes = graph.info(graph.root(*v)).physical.bytes() * unit as u64 / rows as u64;
            unit *= (align / gcd(align, bytes.max(1))) as usize;
        }
    }
    // Without values of its own a chain saves nothing by going in chunks.
    (!interior.is_empty() && unit < rows).then_some(Chain { rows, unit, row_wise, interior })
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn lcm(a: usize, b: usize) -> usize {
    a / gcd(a as u64, b as u64) as usize * b
}
