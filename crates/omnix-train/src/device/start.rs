//! From a recipe and its folder to a step that is ready on a device.

use std::borrow::Cow;
use std::collections::BTreeMap;

use omnix_graph::{GraphError, ParameterSource};
use omnix_kernels::{Caps, Gpu, WeightType};
use omnix_model::{Dropout, Network, PATCH, Parts, manifest};

use super::plan::{Objective, Room, StepPlan};
use super::size::Size;
use super::step::DeviceStep;
use super::update::Optimiser;
use crate::TrainError;
use crate::config::{Copies, Recipe};
use crate::init::StartValues;
use crate::interface::{Part, Step as _};
use crate::session::Session;

/// Plans the steps that a recipe asks for. No device is needed. `budget` takes the place of the recipe's own.
///
/// # Errors
/// Sizes that are no multiples of a patch; what [`StepPlan::new`] refuses.
pub fn planned(recipe: &Recipe, caps: &Caps, budget: Option<u64>) -> Result<StepPlan, TrainError> {
    planned_among(recipe, caps, budget, 1)
}

/// [`planned`] for one of `peers` processes that train together: they hold gradients twice more.
///
/// # Errors
/// As [`planned`].
pub fn planned_among(recipe: &Recipe, caps: &Caps, budget: Option<u64>, peers: u32) -> Result<StepPlan, TrainError> {
    let config = &recipe.config;
    let [width, height] = config.sample.size.map(|side| side as usize);
    if !width.is_multiple_of(PATCH) || !height.is_multiple_of(PATCH) || width * height == 0 {
        return Err(TrainError::contradiction("sample.size", "both sides are multiples of 14"));
    }
    let size = Size { images: config.sample.images as usize, grid: (height / PATCH, width / PATCH) };
    let budget = match budget {
        Some(bytes) => Some(bytes),
        None => config.budget_bytes()?,
    };
    let dropout = (config.dropout > 0.0).then_some(Dropout { share: config.dropout, seed: config.seed });
    let objective = Objective { loss: &config.loss, groups: &config.group, dropout };
    let gradients = u64::from(config.optimiser.accumulate > 1 || peers > 1) + u64::from(peers > 1);
    let copies = match config.weights_type {
        Copies::F32 => WeightType::F32,
        Copies::F16 => WeightType::F16,
    };
    let room = Room { caps, budget, gradients, averaged: config.averaged(), copies };
    StepPlan::new(&Network::new(recipe.network.clone()), size, objective, room)
}

/// The same steps in the least memory that will do.
///
/// # Errors
/// As [`planned`].
pub fn planned_least(recipe: &Recipe, caps: &Caps) -> Result<StepPlan, TrainError> {
    match planned(recipe, caps, Some(0)) {
        Err(TrainError::Graph(GraphError::Budget { least, .. })) => planned(recipe, caps, Some(least)),
        other => other,
    }
}

/// Makes a session's step ready with its start values: random ones, or those of a checkpoint.
///
/// # Errors
/// As [`planned`]; a checkpoint that cannot be read, and failures of the device.
pub fn ready(session: &Session, gpu: &Gpu, budget: Option<u64>) -> Result<DeviceStep, TrainError> {
    ready_among(session, gpu, budget, 1)
}

/// [`ready`] in one of `peers` processes that train together.
///
/// # Errors
/// As [`ready`].
pub fn ready_among(session: &Session, gpu: &Gpu, budget: Option<u64>, peers: u32) -> Result<DeviceStep, TrainError> {
    let recipe = session.recipe();
    let config = &recipe.config;
    let plan = planned_among(recipe, &gpu.caps, budget, peers)?;
    let set = &config.optimiser;
    let optimiser = Optimiser {
        betas: set.betas,
        eps: set.eps as f32,
        max_norm: if set.clip > 0.0 { set.clip as f32 } else { f32::INFINITY },
        accumulate: set.accumulate,
        peers,
    };
    let expected = manifest(&recipe.network, &Parts::default());
    let shapes = expected.expected().iter().map(|t| (t.name.clone(), t.shape.clone())).collect();
    let source = Started { values: session.start_values()?, shapes };
    let layout = plan.layout.clone();
    let mut start: Vec<Vec<f32>> = layout.arenas.iter().map(|arena| vec![0.0; arena.range.len()]).collect();
    for slot in &layout.slots {
        let values = source.values.tensor(&slot.name, &slot.shape)?;
        let from = slot.range.start - layout.arenas[slot.arena].range.start;
        start[slot.arena][from..from + values.len()].copy_from_slice(&values);
    }
    let mut step = DeviceStep::new(gpu, plan, optimiser, config.averaged(), Box::new(source))?;
    for (index, numbers) in start.into_iter().enumerate() {
        step.write(Part::Weights, index, &numbers).map_err(TrainError::Step)?;
        if config.averaged() {
            step.write(Part::Average, index, &numbers).map_err(TrainError::Step)?;
        }
    }
    Ok(step)
}

/// Start values as parameters of plans: of tensors that stay as they are.
struct Started {
    values: StartValues,
    shapes: BTreeMap<String, Vec<usize>>,
}

impl ParameterSource for Started {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        let shape = self.shapes.get(name).ok_or_else(|| format!("BUG: the network has no tensor `{name}`"))?;
        Ok(Cow::Owned(self.values.tensor(name, shape)?))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::read_config;

    #[test]
    fn dropout_is_of_training_alone() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes/smoke.toml");
        let mut recipe = read_config(&path).unwrap();
        let mut planned = |dropout| {
            recipe.config.dropout = dropout;
            planned(&recipe, &Caps::lavapipe(), None).unwrap()
        };
        let (with, without) = (planned(0.1), planned(0.0));
        assert!(with.takes.flops > without.takes.flops);
        assert_eq!(with.forward_flops(), without.forward_flops());
    }
}
