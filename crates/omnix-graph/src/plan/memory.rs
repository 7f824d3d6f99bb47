//! Which buffer every value lives in.
//!
//! Intermediates share whole buffers ("shared objects"): largest first, each into the smallest buffer that is free
//! for as long as it lives. Whole buffers, because WebGPU rejects one buffer bound read-only and read-write in
//! one dispatch even for disjoint ranges; two values that a node touches are alive together and never share.

use std::collections::BTreeMap;

use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::dispatch::round_up;

use super::schedule::{Segment, last_uses};
use crate::error::GraphError;
use crate::graph::{Operation as _, Source, Value};
use crate::ops::Graph;

/// Where a value lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A shared buffer of the arena.
    Arena(usize),
    /// A buffer of its own: inputs and outputs.
    Own,
    /// With the weights.
    Weight,
    /// With the constants.
    Constant,
    /// Never touched.
    Unused,
}

/// The buffers of a plan.
#[derive(Clone, Debug)]
pub struct MemoryPlan {
    /// For each value's root.
    pub places: Vec<Place>,
    /// Bytes of each root as stored (one chunk for values that live inside a chain).
    pub bytes: Vec<u64>,
    /// Sizes of the shared buffers.
    pub arena: Vec<u64>,
    /// Bytes of inputs and outputs.
    pub own: u64,
    /// Bytes of constants.
    pub constants: u64,
}

impl MemoryPlan {
    /// Bytes of everything but the weights.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.arena.iter().sum::<u64>() + self.own + self.constants
    }
}

/// A value's life in node indices, both ends included.
struct Life {
    root: usize,
    bytes: u64,
    from: usize,
    to: usize,
}

/// A plan of memory before intermediates share buffers.
pub(super) struct Lives {
    plan: MemoryPlan,
    lives: Vec<Life>,
}

impl Lives {
    /// Bytes that no sharing goes below: what is alive at once.
    pub(super) fn least(&self) -> u64 {
        let last = self.lives.iter().map(|life| life.from.max(if life.to == usize::MAX { 0 } else { life.to })).max();
        let mut change = vec![(0, 0); last.map_or(0, |last| last + 2)];
        for life in &self.lives {
            change[life.from].0 += life.bytes;
            if let Some(after) = change.get_mut(life.to.saturating_add(1)) {
                after.1 += life.bytes;
            }
        }
        let alive = change.iter().scan(0, |alive, (begun, ended)| {
            *alive = *alive + begun - ended;
            Some(*alive)
        });
        alive.max().unwrap_or(0) + self.plan.total()
    }

    /// Assigns buffers.
    pub(super) fn share(self) -> MemoryPlan {
        let Self { mut plan, lives } = self;
        share(&mut plan, lives);
        plan
    }
}

/// The lives of values when every chain goes in about `parts` parts and the `fixed` first nodes run once, before all runs.
///
/// # Errors
/// When a value is larger than `max_buffer`.
pub(super) fn lives(
    graph: &Graph,
    segments: &[Segment],
    fixed: usize,
    parts: usize,
    max_buffer: u64,
) -> Result<Lives, GraphError> {
    let n = graph.count();
    let mut plan =
        MemoryPlan { places: vec![Place::Unused; n], bytes: vec![0; n], arena: Vec::new(), own: 0, constants: 0 };
    let windowed = windowed_roots(graph);
    let last = last_uses(graph);
    let mut segment_of = vec![0; graph.nodes.len()];
    for (s, segment) in segments.iter().enumerate() {
        segment_of[segment.nodes.clone()].fill(s);
    }
    // Values that cross the border of a chain in chunks live for all of it: every chunk touches them.
    let span = |i: usize| {
        let segment = &segments[segment_of[i]];
        if segment.chain.is_some() && parts > 1 { segment.nodes.clone() } else { i..i + 1 }
    };
    let used = used_roots(graph);
    let mut lives = Vec::new();
    for root in (0..n).filter(|r| used[*r]) {
        let info = graph.info(Value(root as u32));
        let mut bytes = round_up(info.physical.bytes().max(4), 256);
        let chain = match info.source {
            Source::Node(i) => {
                segments[segment_of[i]].chain.as_ref().filter(|c| c.interior.contains(&Value(root as u32)))
            }
            _ => None,
        };
        if let Some(chain) = chain {
            // Layouts pad every group of tokens to 32, so a chunk may take more than its share of the whole.
            let share = chain.chunk_rows(parts) as f64 / chain.rows as f64;
            bytes =
                round_up((info.physical.bytes() as f64 * share).ceil() as u64 + chunk_padding(graph, root, share), 256);
        }
        if windowed[root] {
            bytes += UNIFORM_WINDOW;
        }
        if bytes > max_buffer && !matches!(info.source, Source::Parameter(_)) {
            return Err(GraphError::TensorTooLarge {
                value: info.name.clone(),
                shape: info.shape.clone(),
                bytes,
                limit: max_buffer,
            });
        }
        plan.bytes[root] = bytes;
        let is_output = last[root] == usize::MAX;
        plan.places[root] = match info.source {
            Source::Input => Place::Own,
            Source::Parameter(_) => Place::Weight,
            Source::Constant(_) => Place::Constant,
            Source::Node(_) if is_output => Place::Own,
            Source::Node(i) => {
                let last = last[root].max(i);
                // Computed once and read by every run: its buffer is never shared.
                if i < fixed && last >= fixed {
                    lives.push(Life { root, bytes, from: i, to: usize::MAX });
                    continue;
                }
                let (made, read) = if chain.is_some() { (i..i + 1, last..last + 1) } else { (span(i), span(last)) };
                lives.push(Life { root, bytes, from: made.start, to: read.end - 1 });
                continue;
            }
            Source::Reshape(_) | Source::StraightThrough { .. } => continue,
        };
        match plan.places[root] {
            Place::Own => plan.own += bytes,
            Place::Constant => plan.constants += bytes,
            _ => {}
        }
    }
    Ok(Lives { plan, lives })
}

/// What a chunk's padding may add: the last tokens of a sequence cut elsewhere are padded to 32 again.
fn chunk_padding(graph: &Graph, root: usize, share: f64) -> u64 {
    let info = graph.info(Value(root as u32));
    let physical = &info.physical;
    if share >= 1.0 || *physical == info.shape { 0 } else { physical.bytes() / physical[2] as u64 * 32 }
}

/// Roots that some kernel reads through 64 KiB uniform windows: keys and values of attention, the field as
/// trajectories read it.
fn windowed_roots(graph: &Graph) -> Vec<bool> {
    let mut windowed = vec![false; graph.count()];
    for node in &graph.nodes {
        for value in node.op.windowed(&node.outputs) {
            windowed[graph.root(value).0 as usize] = true;
        }
    }
    windowed
}

/// Roots that some node touches, and outputs.
fn used_roots(graph: &Graph) -> Vec<bool> {
    let mut used = vec![false; graph.count()];
    let touched = graph.nodes.iter().flat_map(|n| n.op.inputs().into_iter().chain(n.outputs.iter().copied()));
    for v in touched.chain(graph.outputs.iter().copied()) {
        used[graph.root(v).0 as usize] = true;
    }
    used
}

/// Greedy by size over shared objects. Where none is free, others make room in one if they fit elsewhere.
fn share(plan: &mut MemoryPlan, mut lives: Vec<Life>) {
    lives.sort_by(|a, b| b.bytes.cmp(&a.bytes).then(a.root.cmp(&b.root)));
    // Sorted by size: every buffer so far is large enough for the value at hand, and the last that is free is the tightest.
    let mut buffers: Vec<Shared<'_>> = Vec::new();
    for life in &lives {
        let free = buffers.iter().rposition(|buffer| buffer.takes(life));
        let buffer = free.or_else(|| make_room(&mut buffers, life)).unwrap_or_else(|| {
            buffers.push(Shared { bytes: life.bytes, tenants: BTreeMap::new(), came: 0 });
            buffers.len() - 1
        });
        buffers[buffer].add(life);
    }
    for (i, buffer) in buffers.iter().enumerate() {
        let tenants = || buffer.tenants.values().map(|(_, life)| life);
        // The largest may have moved.
        plan.arena.push(tenants().map(|life| life.bytes).max().unwrap_or(0));
        tenants().for_each(|life| plan.places[life.root] = Place::Arena(i));
    }
}

/// A shared buffer and the values that live in it one after another.
struct Shared<'a> {
    bytes: u64,
    /// By the first node of their lives: how many came before each, and its life. No two meet.
    tenants: BTreeMap<usize, (usize, &'a Life)>,
    came: usize,
}

impl<'a> Shared<'a> {
    fn takes(&self, life: &Life) -> bool {
        life.bytes <= self.bytes && self.meeting(life).next().is_none()
    }

    /// Tenants that are alive with `life`, the last first: of those that begin before its end, later ones end later.
    fn meeting(&self, life: &Life) -> impl Iterator<Item = &(usize, &'a Life)> {
        let from = life.from;
        self.tenants.range(..=life.to).rev().map(|(_, tenant)| tenant).take_while(move |(_, tenant)| tenant.to >= from)
    }

    fn add(&mut self, life: &'a Life) {
        self.tenants.insert(life.from, (self.came, life));
        self.came += 1;
    }

    fn remove(&mut self, life: &Life) {
        self.tenants.remove(&life.from);
    }
}

/// A buffer from which all that are alive with `life` could move to others, and did.
fn make_room(buffers: &mut [Shared<'_>], life: &Life) -> Option<usize> {
    (0..buffers.len()).rev().find(|&at| {
        // In the order in which they came.
        let mut leaving: Vec<(usize, &Life)> = buffers[at].meeting(life).copied().collect();
        leaving.sort_unstable_by_key(|(came, _)| *came);
        let mut moved = Vec::with_capacity(leaving.len());
        for (_, tenant) in &leaving {
            let Some(to) = (0..buffers.len()).rev().find(|to| *to != at && buffers[*to].takes(tenant)) else { break };
            buffers[to].add(tenant);
            moved.push(to);
        }
        let all = moved.len() == leaving.len();
        for ((_, tenant), to) in leaving.iter().zip(moved) {
            // From where they were, or back to there.
            buffers[if all { at } else { to }].remove(tenant);
        }
        all
    })
}
