//! What stays for the backward pass: levels from little recomputation to much.
//!
//! Two things make a level. Borders cut the forward pass into segments; what crosses a border stays, so that no value is computed again
//! from further back. They lie where the fewest bytes cross: between the layers of a network, which this file does not know. And within
//! the segments, values that the backward pass reads are given up in the order of their price, operations for a byte: norms and moves
//! first, then products, attention over many keys last. Of values of one price the early ones go first, since they are kept longest.
//! Levels differ in how long segments are and in how many values are given up; of all that are tried those remain that take fewer bytes
//! than every cheaper one.

use super::facts::Facts;
use super::order::{order, peak, repeated};
use crate::ops::Graph;

/// Lengths of segments that are tried: each shorter than the one before by the root of two.
const LENGTHS: i32 = 20;

/// Shares of the bytes that can be given up: this number of equal steps.
const STEPS: u64 = 32;

/// A way to compute values again.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Nodes in the order in which they run; those that come twice are computed twice.
    pub(crate) order: Vec<u32>,
    /// Operations of what is computed again.
    pub(crate) flops: u64,
}

/// Levels of recomputation, from the fewest operations to the fewest bytes; none where nothing is differentiated or gained. The `fixed`
/// first nodes of the graph are computed once, before all runs.
pub(crate) fn levels(graph: &Graph, fixed: usize) -> Vec<Level> {
    let Some(facts) = Facts::of(graph, fixed) else { return Vec::new() };
    let without: Vec<u32> = (0..facts.nodes.len() as u32).collect();
    let mut least = peak(&facts, &without);
    let mut all = tried(&facts);
    all.sort_by_key(|level| (level.flops, level.peak));
    all.retain(|level| {
        let better = level.peak < least;
        least = least.min(level.peak);
        better
    });
    let of = |level: Tried| Level { order: order(&facts, &level.stays), flops: level.flops };
    all.into_iter().map(of).collect()
}

/// A level as it is tried.
struct Tried {
    /// By node, whether its results stay.
    stays: Vec<bool>,
    flops: u64,
    /// Bytes that are alive at once at most, but for what is always there.
    peak: u64,
}

fn tried(facts: &Facts) -> Vec<Tried> {
    let mut all = Vec::new();
    let candidates = by_price(facts);
    let total: u64 = candidates.iter().map(|node| facts.kept_bytes(*node)).sum();
    let mut before = None;
    for length in 0..=LENGTHS {
        let borders = borders(facts, (total as f64 * 0.5f64.powf(f64::from(length) / 2.0)) as u64);
        if before.as_ref() == Some(&borders) {
            continue;
        }
        let mut stays: Vec<bool> = (0..facts.nodes.len()).map(|node| always_stays(facts, &borders, node)).collect();
        let given_up: Vec<usize> = candidates.iter().copied().filter(|node| !stays[*node]).collect();
        let all_bytes: u64 = given_up.iter().map(|node| facts.kept_bytes(*node)).sum();
        given_up.iter().for_each(|node| stays[*node] = true);
        let (mut bytes, mut step) = (0, 1);
        for node in given_up {
            stays[node] = false;
            bytes += facts.kept_bytes(node);
            if bytes * STEPS >= all_bytes * step {
                step = bytes * STEPS / all_bytes.max(1) + 1;
                let order = order(facts, &stays);
                let (flops, peak) = (repeated(facts, &order), peak(facts, &order));
                all.push(Tried { stays: stays.clone(), flops, peak });
            }
        }
        before = Some(borders);
    }
    all
}

/// Nodes of the forward pass with results that the backward pass reads, from the lowest price of computing them again to the highest.
fn by_price(facts: &Facts) -> Vec<usize> {
    // Operations of a node, and of what it reads that no one keeps.
    let mut costs = vec![0.0f64; facts.late];
    for at in facts.first..facts.late {
        let node = &facts.nodes[at];
        let makers = node.reads.iter().map(|value| facts.values[*value as usize].maker);
        let unkept = makers.filter(|maker| facts.kept_bytes(*maker) == 0 && !facts.nodes[*maker].once);
        costs[at] = node.flops as f64 + unkept.map(|maker| costs[maker]).sum::<f64>();
    }
    let can = |at: &usize| facts.kept_bytes(*at) > 0 && !facts.nodes[*at].once;
    let mut nodes: Vec<usize> = (facts.first..facts.late).filter(can).collect();
    let price = |at: &usize| costs[*at] / facts.kept_bytes(*at) as f64;
    nodes.sort_by(|a, b| price(a).total_cmp(&price(b)).then(a.cmp(b)));
    nodes
}

/// Whether results of a node stay at every level with these borders, if anything reads them: they cross a border, or the node runs once.
fn always_stays(facts: &Facts, borders: &[usize], at: usize) -> bool {
    let crosses = |value: &u32| {
        let last = facts.values[*value as usize].last;
        borders.get(borders.partition_point(|border| *border <= at)).is_some_and(|border| *border <= last)
    };
    at < facts.first || facts.nodes[at].once || facts.nodes[at].makes.iter().any(crosses)
}

/// Where segments begin, but for the first: each ends where the fewest bytes cross, before it has more than `length` bytes for the
/// backward pass or after its first node.
fn borders(facts: &Facts, length: u64) -> Vec<usize> {
    let crossing = crossing(facts);
    let mut borders = Vec::new();
    let (mut start, mut bytes) = (facts.first, 0);
    for at in facts.first..facts.late {
        bytes += facts.kept_bytes(at);
        while bytes > length && at > start {
            // The last of the narrowest places.
            let narrowest = (start + 1..=at).rev().min_by_key(|place| crossing[*place]);
            start = narrowest.unwrap_or(at);
            borders.push(start);
            bytes = (start..=at).map(|at| facts.kept_bytes(at)).sum();
        }
    }
    borders
}

/// For each node of the forward pass, bytes that nodes before it make and it or later ones of the forward pass read.
fn crossing(facts: &Facts) -> Vec<u64> {
    let mut change = vec![0i64; facts.late + 1];
    for value in facts.values.iter().filter(|value| value.last > value.maker) {
        change[value.maker + 1] += value.bytes as i64;
        change[value.last + 1] -= value.bytes as i64;
    }
    let mut sum = 0;
    change
        .iter()
        .map(|change| {
            sum += change;
            sum as u64
        })
        .collect()
}
