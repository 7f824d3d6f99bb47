//! What happens between two steps, as graphs over whole arenas: gradients added up, clipped, weights and moments changed, averages.

use omnix_graph::ops::AdamW;
use omnix_graph::{Bindings, Executable, Graph, GraphError, Plan, PlanOptions, Value, WeightStore};
use omnix_kernels::{Gpu, adamw};

use super::state::List;
use crate::groups::Layout;

/// How AdamW is set for a whole training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimiser {
    /// Shares of the old means.
    pub betas: [f64; 2],
    /// Added to the root of the second mean.
    pub eps: f32,
    /// The norm that all gradients together are clipped to; infinity for none.
    pub max_norm: f32,
    /// Samples whose gradients this process adds up before an update.
    pub accumulate: u32,
    /// Processes that train together, each with as many samples.
    pub peers: u32,
}

impl Optimiser {
    /// Samples of an update, of all processes.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.accumulate.max(1).saturating_mul(self.peers.max(1))
    }
}

/// The lists that an update reads and writes.
pub(super) struct Lists<'a> {
    pub(super) weights: &'a List,
    pub(super) first: &'a List,
    pub(super) second: &'a List,
    pub(super) gradients: &'a List,
    pub(super) average: Option<&'a List>,
}

/// One step of AdamW over all arenas.
pub(super) fn update(
    gpu: &Gpu,
    layout: &Layout,
    optimiser: &Optimiser,
    lists: &Lists<'_>,
) -> Result<Executable, GraphError> {
    let mut g = Graph::new();
    let mut bindings = Bindings::default();
    let mut input = |g: &mut Graph, name: &str, list: &List| -> Vec<Value> {
        let arena = |(index, arena): (usize, &crate::groups::Arena)| {
            let name = format!("{name}.{index}");
            bindings.insert(name.clone(), list.arena(index));
            g.input(&name, [arena.range.len()])
        };
        layout.arenas.iter().enumerate().map(arena).collect()
    };
    let weights = input(&mut g, "weights", lists.weights);
    let first = input(&mut g, "first", lists.first);
    let second = input(&mut g, "second", lists.second);
    let gradients = input(&mut g, "gradients", lists.gradients);
    let average = lists.average.map(|list| input(&mut g, "average", list));
    let rates: Vec<Value> =
        (0..layout.groups.len()).map(|group| g.input(&rates(group), [adamw::RATES_WORDS as usize])).collect();
    let scale = 1.0 / optimiser.samples() as f32;
    let clip = g.grad_norm(&gradients, optimiser.max_norm, scale)?;
    g.output(clip, CLIP);
    for (index, arena) in layout.arenas.iter().enumerate() {
        g.adamw(&AdamW {
            state: [weights[index], first[index], second[index]],
            gradient: gradients[index],
            rates: rates[arena.group],
            clip: Some(clip),
            betas: optimiser.betas,
            eps: optimiser.eps,
            scale: 1.0,
        })?;
    }
    if let Some(average) = average {
        let shares = g.input(SHARES, [2]);
        for (average, weights) in average.into_iter().zip(weights) {
            g.blend(average, weights, shares)?;
        }
    }
    run_on(gpu, &g, &bindings)
}

/// Adds the gradients of a sample to those of the samples before it: `shares` are 0 and 1 for the first, 1 and 1 after it.
pub(super) fn accumulate(gpu: &Gpu, layout: &Layout, sums: &List, parts: &List) -> Result<Executable, GraphError> {
    let mut g = Graph::new();
    let mut bindings = Bindings::default();
    let shares = g.input(SHARES, [2]);
    for (index, arena) in layout.arenas.iter().enumerate() {
        let mut input = |name: &str, list: &List| {
            let name = format!("{name}.{index}");
            bindings.insert(name.clone(), list.arena(index));
            g.input(&name, [arena.range.len()])
        };
        let (sum, part) = (input("sums", sums), input("parts", parts));
        g.blend(sum, part, shares)?;
    }
    run_on(gpu, &g, &bindings)
}

/// Name of the output of an update: factor, norm, whether the norm is NaN or infinite.
pub(super) const CLIP: &str = "clip";
/// Name of the input that says how two lists are mixed.
pub(super) const SHARES: &str = "shares";

/// Name of the input of a group's rates.
pub(super) fn rates(group: usize) -> String {
    format!("rates.{group}")
}

fn run_on(gpu: &Gpu, g: &Graph, bindings: &Bindings) -> Result<Executable, GraphError> {
    let plan = Plan::new(g, &gpu.caps, &PlanOptions::default())?;
    Executable::new(gpu, plan, &WeightStore::default(), bindings)
}
