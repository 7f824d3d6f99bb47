//! What a step needs, known before it runs and without a device.

use omnix_graph::{Graph, GraphError, Plan, PlanOptions, Value};
use omnix_kernels::Caps;
use omnix_model::{Dropout, Network, Parts, TimeCode, TrainingSpec, manifest};

use super::size::Size;
use super::targets::{self, Wanted};
use crate::TrainError;
use crate::groups::{ARENA, Group, Layout, Tensor};
use crate::loss::LossConfig;

/// A planned step: forward and backward, forward alone, and where trained tensors lie.
#[derive(Debug)]
pub struct StepPlan {
    /// The samples' shape.
    pub size: Size,
    /// Where the trained tensors lie.
    pub layout: Layout,
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

/// A network with its losses.
struct Recorded {
    graph: Graph,
    total: Value,
    names: Vec<String>,
    codes: Vec<TimeCode>,
}

/// Name of the output with all losses.
pub(super) const LOSSES: &str = "losses";

impl StepPlan {
    /// Plans steps of `network` on samples of this size. `budget`: bytes that the device may give; `None` for no bound.
    ///
    /// # Errors
    /// A network that cannot make what the objective compares, groups that do not fit its tensors, a budget that is too small.
    pub fn new(
        network: &Network,
        size: Size,
        objective: Objective<'_>,
        (caps, budget): (&Caps, Option<u64>),
    ) -> Result<Self, TrainError> {
        let Objective { loss, groups, dropout } = objective;
        let forward = record(network, size, loss, None)?;
        let Recorded { graph: mut g, total, .. } = record(network, size, loss, dropout)?;
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
        let options = PlanOptions::default().budget(budget);
        let plan = |g: &Graph| -> Result<Plan, GraphError> { Plan::new(&g.adopt(&trained)?, caps, &options) };
        Ok(Self {
            size,
            train: plan(&g)?,
            forward: plan(&forward.graph)?,
            layout,
            codes: forward.codes,
            losses: forward.names,
            wanted: Wanted { moves: network.config().trajectory.is_some(), share: loss.moving_share },
        })
    }

    /// Numbers that are trained, gaps of the layout included.
    #[must_use]
    pub fn trained(&self) -> u64 {
        self.layout.arenas.iter().map(|arena| arena.range.len() as u64).sum()
    }

    /// Bytes that training takes on the device: intermediates, inputs, weights, gradients, both moments, and the lists that accumulation
    /// and an average ask for (`more` of them).
    #[must_use]
    pub fn bytes(&self, more: u64) -> u64 {
        // Weights and gradients are inputs and outputs of the plan.
        self.train.working_bytes() + self.train.weight_bytes() + (2 + more) * 4 * self.trained()
    }

    /// Operations of forward and backward on one sample.
    #[must_use]
    pub fn flops(&self) -> u64 {
        self.train.flops()
    }

    /// Operations of the forward pass alone.
    #[must_use]
    pub fn forward_flops(&self) -> u64 {
        self.forward.flops()
    }
}

/// Records a network and its losses, which are the only output.
fn record(network: &Network, size: Size, loss: &LossConfig, dropout: Option<Dropout>) -> Result<Recorded, TrainError> {
    let mut graph = Graph::new();
    let moves = network.config().trajectory.is_some();
    let ungated = moves && loss.weights.displacement != 0.0;
    let spec = TrainingSpec { images: size.images, grid: size.grid, motion: moves, ungated, dropout };
    let made = network.training(&mut graph, &spec)?;
    let terms = targets::terms(&mut graph, &made, &size, loss)?;
    let losses = terms.record(&mut graph, loss)?;
    graph.forget_outputs();
    gather(&mut graph, &losses.names)?;
    Ok(Recorded { graph, total: losses.total, names: losses.names, codes: made.codes })
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
