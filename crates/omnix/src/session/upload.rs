//! The weights of the stages: all on the device for as long as the session lives, or those of one stage at a time.

use std::collections::BTreeSet;

use omnix_graph::WeightStore;
use omnix_graph::weights::WeightKey;
use omnix_kernels::Gpu;
use rayon::prelude::*;

use super::Listener;
use crate::error::OmnixError;
use crate::plan::RunPlan;
use crate::progress::{Phase, Progress};
use crate::weights::Weights;

/// Stages that have weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Backbone,
    Head,
    Module,
    Sampling,
}

const STAGES: [Stage; 4] = [Stage::Backbone, Stage::Head, Stage::Module, Stage::Sampling];

/// Weights on the device.
#[derive(Debug)]
pub(super) struct StageWeights {
    gpu: Gpu,
    weights: Weights,
    /// The stage whose weights these are; none for all of them.
    stage: Option<Stage>,
    store: WeightStore,
}

impl StageWeights {
    /// Uploads all weights or those of the backbone; the others are looked through for numbers that are none, so that no
    /// work is lost to a damaged file later.
    pub(super) fn new(
        gpu: &Gpu,
        weights: &Weights,
        plan: &RunPlan,
        progress: Listener<'_>,
    ) -> Result<Self, OmnixError> {
        let stage = if plan.request.keep_weights { None } else { Some(Stage::Backbone) };
        if stage.is_some() {
            let later = STAGES.iter().skip(1).flat_map(|stage| keys(plan, *stage));
            let names: BTreeSet<&str> = later.map(|key| &*key.parameter.name).collect();
            let bad = names.into_par_iter().find_map_first(|name| weights.check_tensor(name).err());
            bad.map_or(Ok(()), Err)?;
        }
        let store = load(gpu, weights, plan, stage, progress)?;
        Ok(Self { gpu: gpu.clone(), weights: weights.clone(), stage, store })
    }

    /// What they are from.
    pub(super) fn checkpoint(&self) -> &Weights {
        &self.weights
    }

    /// What is on the device.
    pub(super) fn store(&self) -> &WeightStore {
        &self.store
    }

    /// The weights of `stage`; if not all are kept, those of the stage before leave first.
    pub(super) fn stage(
        &mut self,
        stage: Stage,
        plan: &RunPlan,
        progress: Listener<'_>,
    ) -> Result<&WeightStore, OmnixError> {
        if self.stage.is_some_and(|there| there != stage) {
            self.store = WeightStore::default();
            // Buffers are given back when the device is next waited for.
            self.gpu.wait()?;
            self.store = load(&self.gpu, &self.weights, plan, Some(stage), progress)?;
            self.stage = Some(stage);
        }
        Ok(&self.store)
    }
}

fn load(
    gpu: &Gpu,
    weights: &Weights,
    plan: &RunPlan,
    stage: Option<Stage>,
    progress: Listener<'_>,
) -> Result<WeightStore, OmnixError> {
    let wanted: Vec<WeightKey> = STAGES
        .iter()
        .filter(|s| stage.is_none_or(|stage| stage == **s))
        .flat_map(|s| keys(plan, *s))
        .cloned()
        .collect();
    let mut report = |done, total| progress(Progress { phase: Phase::Weights, done, total });
    Ok(WeightStore::load(gpu, weights, &wanted, &mut report)?)
}

fn keys(plan: &RunPlan, stage: Stage) -> &[WeightKey] {
    let motion = plan.motion.as_ref();
    match stage {
        Stage::Backbone => &plan.backbone.weights,
        Stage::Head => &plan.head.weights,
        Stage::Module => motion.map_or(&[], |m| &m.module.weights),
        Stage::Sampling => motion.map_or(&[], |m| &m.sampling.weights),
    }
}
