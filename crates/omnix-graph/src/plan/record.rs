//! From planned nodes to dispatches over slices of buffers: one call per kernel, one chunk at a time inside chains.

use omnix_kernels::Dispatch;
use smallvec::SmallVec;

use super::Plan;
use super::memory::Place;
use super::schedule::Chain;
use super::weights::weight_key;
use crate::error::GraphError;
use crate::graph::{Access, Operation as _, Packing, Site, Value};
use crate::ops::{Graph, Node};

/// What a slot refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stored {
    /// A value's root.
    Value(Value),
    /// An index into the plan's weights.
    Weight(usize),
}

/// Part of a stored tensor, in bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) value: Stored,
    pub(crate) offset: u64,
    pub(crate) size: u64,
}

/// The dispatches of one kernel call and its arguments.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    pub(crate) node: usize,
    pub(crate) name: String,
    pub(crate) args: SmallVec<[Slot; 8]>,
    pub(crate) dispatches: Vec<Dispatch>,
}

/// One chunk of a chain: rows `start..start + rows` of `chain`.
#[derive(Clone, Copy)]
struct Chunk<'a> {
    chain: &'a Chain,
    /// Index of the node within the chain.
    position: usize,
    start: usize,
    rows: usize,
}

impl Chunk<'_> {
    /// Offset and size of its rows in a value of `whole` bytes.
    fn part_of(&self, whole: u64) -> (u64, u64) {
        let bytes = |rows: usize| whole * rows as u64 / self.chain.rows as u64;
        (bytes(self.start), bytes(self.rows))
    }
}

/// Records every node of `plan`.
pub(crate) fn record(plan: &Plan) -> Result<Vec<Recorded>, GraphError> {
    let mut out = Vec::new();
    for segment in &plan.segments {
        match &segment.chain {
            Some(chain) if plan.parts > 1 => {
                let rows = chain.chunk_rows(plan.parts);
                for start in (0..chain.rows).step_by(rows) {
                    let rows = rows.min(chain.rows - start);
                    for (position, node) in segment.nodes.clone().enumerate() {
                        record_node(plan, node, Some(Chunk { chain, position, start, rows }), &mut out)?;
                    }
                }
            }
            _ => {
                for node in segment.nodes.clone() {
                    record_node(plan, node, None, &mut out)?;
                }
            }
        }
    }
    Ok(out)
}

fn record_node(plan: &Plan, index: usize, chunk: Option<Chunk<'_>>, out: &mut Vec<Recorded>) -> Result<(), GraphError> {
    let node = &plan.graph.nodes[index];
    let site = Site {
        name: node.op.name(),
        values: &plan.graph,
        outputs: &node.outputs,
        caps: &plan.caps,
        storage: plan.storage,
        chunk: chunk.map(|c| c.rows),
    };
    for call in node.op.lower(&site)? {
        let args = call.args.iter().map(|value| slot(plan, node, *value, chunk)).collect::<Result<_, _>>()?;
        let name = plan.graph.value_name(node.outputs[0]).to_owned();
        out.push(Recorded { node: index, name, args, dispatches: call.dispatches });
    }
    Ok(())
}

/// The part of `value` that a chunk of `node` sees; absent arguments repeat the node's first output, unbound.
fn slot(plan: &Plan, node: &Node, value: Option<Value>, chunk: Option<Chunk<'_>>) -> Result<Slot, GraphError> {
    let graph = &plan.graph;
    let value = value.unwrap_or(node.outputs[0]);
    let root = graph.root(value);
    if plan.memory.places[root.0 as usize] == Place::Weight {
        let key = weight_key(graph, node, value, plan.storage);
        let found = key.and_then(|key| plan.weights.iter().position(|k| *k == key));
        let missing = || GraphError::NoSuchValue { name: graph.value_name(value).to_owned() };
        let index = found.ok_or_else(missing)?;
        let key = &plan.weights[index];
        // Only what is stored as it is has rows that a chunk could see.
        let (offset, size) = match chunk {
            Some(chunk) if key.packing == Packing::Plain && access(graph, node, value, chunk) == Access::Rows => {
                chunk.part_of(graph.info(root).physical.bytes())
            }
            _ => (0, key.bytes()),
        };
        return Ok(Slot { value: Stored::Weight(index), offset, size });
    }
    let whole = graph.info(root).physical.bytes();
    let (offset, size) = match chunk {
        None => (0, whole),
        Some(chunk) if chunk.chain.interior.contains(&root) => (0, plan.memory.bytes[root.0 as usize]),
        Some(chunk) => match access(graph, node, value, chunk) {
            Access::Rows => chunk.part_of(whole),
            Access::Whole | Access::Interior => (0, whole),
        },
    };
    Ok(Slot { value: Stored::Value(root), offset, size })
}

fn access(graph: &Graph, node: &Node, value: Value, chunk: Chunk<'_>) -> Access {
    let row_wise = &chunk.chain.row_wise[chunk.position];
    let inputs = node.op.inputs();
    let seen = inputs.iter().zip(&row_wise.inputs).chain(node.outputs.iter().zip(&row_wise.outputs));
    let root = graph.root(value);
    seen.filter(|(v, _)| graph.root(**v) == root).map(|(_, access)| *access).next().unwrap_or(Access::Whole)
}
