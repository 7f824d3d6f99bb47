//! What a step needs, known before it runs and without a device.

use omnix_graph::passes::adopt::parameter_input;
use omnix_graph::{Graph, GraphError, Plan, PlanOptions, Value};
use omnix_kernels::{Caps, WeightType};
use omnix_model::{Dropout, Network, Parts, TimeCode, TrainingSpec, manifest};

use super::size::Size;
use super::targets::{self, Wanted};
use crate::TrainError;
use crate::groups::{ARENA, Group, Layout, Slot, Tensor};
use crate::loss::LossConfig;

/// A planned step: forward and backward, forward alone, and where trained tensors lie.
#[derive(Debug)]
pub struct StepPlan {
    /// The samples' shape.
    pub size: Size,
    /// Where the trained tensors lie.
    pub layout: Layout,
    /// What a step takes as it is planned.
    pub takes: Takes,
    /// What it would take if everything that the backward pass reads were kept.
    pub without: Takes,
    pub(super) train: Plan,
    pub(super) forward: Plan,
    /// Inputs that hold codes of the images' times.
    pub codes: Vec<TimeCode>,
    /// Names of the numbers of the output [`LOSSES`].
    pub(super) losses: Vec<String>,
    pub(super) wanted: Wanted,
}

/// What a step makes smaller, and by which tensors.
#[derive(Clone, Copy, Debug)]
pub struct Objective<'a> {
    /// The losses.
    pub loss: &'a LossConfig,
    /// Which tensors are trained.
    pub groups: &'a [Group],
    /// What is left out at random, in training alone.
    pub dropout: Option<Dropout>,
}

/// Where steps run, and what they keep there.
#[derive(Clone, Copy, Debug)]
pub struct Room<'a> {
    /// The device's facts.
    pub caps: &'a Caps,
    /// Bytes that the device may give; `None` for no bound.
    pub budget: Option<u64>,
    /// Lists of gradients beside that of the sample at hand: one where several samples are added up, two where several processes are.
    pub gradients: u64,
    /// Whether an average of the weights is kept.
    pub averaged: bool,
    /// How the copies of the weights are stored that products read.
    pub copies: WeightType,
}

/// What a step takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Takes {
    /// Bytes on the device: intermediates, inputs, weights, gradients, both moments, what accumulation and an average ask for, and the
    /// forward pass alone, which is for validation.
    pub bytes: u64,
    /// Floating-point operations of forward and backward on one sample.
    pub flops: u64,
}

/// A network with its losses.
struct Recorded {
    graph: Graph,
    total: Value,
    names: Vec<String>,
    codes: Vec<TimeCode>,
    /// What the network says, in the order of [`ANSWER`].
    answer: Vec<Value>,
}

/// Name of the output with all losses.
pub(super) const LOSSES: &str = "losses";
/// Names of what the forward pass also says: depth, camera codes, and where there is motion trajectories and scores of pixels.
pub(super) const ANSWER: [&str; 4] = ["answer.depth", "answer.cameras", "answer.paths", "answer.theta"];

impl StepPlan {
    /// Plans steps of `network` on samples of this size. Where they do not fit the budget, values of the forward pass are computed again
    /// for the backward pass instead of kept: as many as it takes. No bit of a result depends on it.
    ///
    /// # Errors
    /// A network that cannot make what the objective compares, groups that do not fit its tensors, a budget that is too small
    /// ([`GraphError::Budget`], with the least that works).
    pub fn new(network: &Network, size: Size, objective: Objective<'_>, room: Room<'_>) -> Result<Self, TrainError> {
        let Objective { loss, groups, dropout } = objective;
        let forward = record(network, size, loss, Purpose::Validation)?;
        let mut answering = forward.graph;
        forward.answer.iter().zip(ANSWER).for_each(|(value, name)| answering.output(*value, name));
        let Recorded { graph: mut g, total, .. } = record(network, size, loss, Purpose::Training(dropout))?;
        let group = |name: &str| groups.iter().find(|group| name.contains(&group.name));
        let reached = g.gradients(total, &|name| group(name).is_some_and(|group| !group.frozen))?;
        let expected = manifest(network.config(), &Parts::default());
        let tensors: Vec<Tensor> = expected
            .expected()
            .iter()
            .map(|t| Tensor { name: t.name.clone(), shape: t.shape.clone(), reached: reached.contains(&t.name) })
            .collect();
        let layout = Layout::new(&tensors, groups, ARENA)?;
        if layout.slots.is_empty() {
            return Err(TrainError::NothingTrains);
        }
        let trained: Vec<String> = layout.slots.iter().map(|slot| slot.name.clone()).collect();
        let evaluated = Plan::new(&answering.adopt(&trained, room.copies)?, room.caps, &PlanOptions::default())?;
        let graph = g.adopt(&trained, room.copies)?;
        let train = |options: PlanOptions| Plan::new(&graph, room.caps, &options);
        let kept = train(PlanOptions::default())?;
        let rest = bytes_beside(&kept, &evaluated, &layout, room);
        let takes = |plan: &Plan| Takes { bytes: plan.working_bytes() + rest, flops: plan.flops() };
        let without = takes(&kept);
        let train = match room.budget.filter(|budget| without.bytes > *budget) {
            None => kept,
            Some(budget) => {
                let options = PlanOptions::default().budget(budget.saturating_sub(rest)).recompute(true);
                train(options).map_err(|error| match error {
                    GraphError::Budget { least, .. } => GraphError::Budget { budget, least: least + rest },
                    error => error,
                })?
            }
        };
        Ok(Self {
            size,
            takes: takes(&train),
            without,
            train,
            forward: evaluated,
            layout,
            codes: forward.codes,
            losses: forward.names,
            wanted: Wanted { moves: network.config().trajectory.is_some(), share: loss.moving_share },
        })
    }

    /// Numbers that are trained, gaps of the layout included.
    #[must_use]
    pub fn trained(&self) -> u64 {
        self.layout.len() as u64
    }

    /// Operations that compute values again instead of keeping them; part of those that a step takes.
    #[must_use]
    pub fn recomputed(&self) -> u64 {
        self.train.recomputed
    }

    /// Operations of the forward pass alone.
    #[must_use]
    pub fn forward_flops(&self) -> u64 {
        self.forward.flops()
    }
}

/// Bytes of what is on the device beside the working memory of the plan `train`: weights and gradients, which are inputs and outputs of
/// that plan, are not.
fn bytes_beside(train: &Plan, forward: &Plan, layout: &Layout, room: Room<'_>) -> u64 {
    let Room { gradients, averaged, .. } = room;
    let lists = 2 + gradients + u64::from(averaged);
    // The forward pass reads the same weights, or their average.
    let input = |slot: &Slot| forward.graph.find(&parameter_input(&slot.name));
    let weights: u64 = layout.slots.iter().filter_map(input).map(|value| forward.bytes(value)).sum();
    let evaluations = 1 + u64::from(averaged);
    train.weight_bytes() + lists * 4 * layout.len() as u64 + evaluations * (forward.working_bytes() - weights)
}

/// What a graph is for.
#[derive(Clone, Copy)]
enum Purpose {
    /// What is left out at random is left out, and the gate of trajectories is that of training.
    Training(Option<Dropout>),
    /// As in inference.
    Validation,
}

/// Records a network and its losses, which are the only output so far.
fn record(network: &Network, size: Size, loss: &LossConfig, purpose: Purpose) -> Result<Recorded, TrainError> {
    let mut graph = Graph::new();
    let moves = network.config().trajectory.is_some();
    let ungated = moves && loss.weights.displacement != 0.0;
    let (dropout, inference) = match purpose {
        Purpose::Training(dropout) => (dropout, false),
        Purpose::Validation => (None, true),
    };
    let spec = TrainingSpec { images: size.images, grid: size.grid, motion: moves, ungated, dropout, inference };
    let made = network.training(&mut graph, &spec)?;
    let terms = targets::terms(&mut graph, &made, &size, loss)?;
    let losses = terms.record(&mut graph, loss)?;
    graph.forget_outputs();
    gather(&mut graph, &losses.names)?;
    let moved = made.motion.iter().flat_map(|motion| [motion.trajectories, motion.theta]);
    let answer = [made.depth, made.pose_codes].into_iter().chain(moved).collect();
    Ok(Recorded { graph, total: losses.total, names: losses.names, codes: made.codes, answer })
}

/// One output of all losses, in the order of `names`: a single readback.
fn gather(g: &mut Graph, names: &[String]) -> Result<(), GraphError> {
    let mut all: Vec<Value> = Vec::with_capacity(names.len());
    for name in names {
        let value = g.find(name).ok_or_else(|| GraphError::NoSuchValue { name: name.clone() })?;
        all.push(g.reshape(value, [1])?);
    }
    let losses = g.concat(&all, 0)?;
    g.output(losses, LOSSES);
    Ok(())
}
