//! A whole run planned: up to four graphs, their chunks and the bytes they take, with no device.
//!
//! Stages, one after another: the backbone over all images; the head, a few images at a time; and, where trajectories are
//! wanted, the trajectory module over all images, the sampling head a few images at a time, and the evaluation of the field.
//! A stage's bytes are its weights (or all weights, if they stay; if it runs once, those of two stretches of it), its own plan's, and
//! what it holds of other stages' results.

mod stages;
mod summary;

use omnix_graph::Plan;

use crate::field::{Chunk, FieldShape};
use crate::request::Request;
pub use summary::{FieldSummary, PlanSummary, StageSummary};

/// Everything a run will do.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RunPlan {
    /// What was asked.
    pub request: Request,
    /// The network over all images: features and cameras.
    pub backbone: Plan,
    /// Depth (and rays, and points) of a few images.
    pub head: Plan,
    /// How many.
    pub head_images: usize,
    /// The stages that make a field, if trajectories are wanted.
    pub motion: Option<MotionPlan>,
    /// Bytes of the features and cameras that stay between the stages.
    kept: u64,
}

/// The stages that make a field.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MotionPlan {
    /// The trajectory module over all images.
    pub module: Plan,
    /// The sampling head over a few images.
    pub sampling: Plan,
    /// How many.
    pub sampling_images: usize,
    /// Sizes of the field.
    pub shape: FieldShape,
    /// Whether the field is kept on the device; else in a spool file.
    pub resident: bool,
    /// Pixels and target times of an evaluation of all pixels of an image.
    pub evaluation: Chunk,
    /// Bytes of such an evaluation, its image's part of the field included where that is not kept on the device.
    evaluation_bytes: u64,
    /// Bytes of the tokens that the head makes for the module.
    token_bytes: u64,
}

/// Staging for reading results back, and parameters of dispatches: a small, bounded extra.
const OVERHEAD: u64 = 4 << 20;

impl RunPlan {
    /// Bytes of all weights.
    #[must_use]
    pub fn weight_bytes(&self) -> u64 {
        self.plans().map(|(plan, _)| plan.weight_bytes()).sum()
    }

    /// Bytes of device memory at the peak of the run.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        self.stages().iter().map(|stage| stage.bytes).max().unwrap_or(0)
    }

    /// Operations of the whole run.
    #[must_use]
    pub fn flops(&self) -> u64 {
        self.plans().map(|(plan, runs)| plan.flops() * runs).sum()
    }

    /// The part of [`RunPlan::flops`] that linear layers and convolutions have, as profilers count that look at layers.
    #[must_use]
    pub fn layer_flops(&self) -> u64 {
        self.plans().map(|(plan, runs)| plan.layer_flops() * runs).sum()
    }

    /// Operations of the head over all images.
    #[must_use]
    pub fn head_flops(&self) -> u64 {
        self.head.flops() * self.head_runs() as u64
    }

    /// How often the head runs.
    pub(crate) fn head_runs(&self) -> usize {
        self.request.images.div_ceil(self.head_images)
    }

    /// Bytes that the budget leaves for evaluations of the field; `None` for no bound.
    #[must_use]
    pub fn evaluation_room(&self) -> Option<u64> {
        let (motion, budget) = (self.motion.as_ref()?, self.request.budget?);
        Some(budget.saturating_sub(self.resting_weights() + OVERHEAD + motion.store_bytes()))
    }

    /// Every plan, and how often it runs.
    pub(crate) fn plans(&self) -> impl Iterator<Item = (&Plan, u64)> {
        let motion = self.motion.iter().flat_map(|m| [(&m.module, 1), (&m.sampling, m.sampling_runs() as u64)]);
        [(&self.backbone, 1), (&self.head, self.head_runs() as u64)].into_iter().chain(motion)
    }

    /// Bytes of the weights that are on the device when no stage runs.
    fn resting_weights(&self) -> u64 {
        if self.request.keep_weights { self.weight_bytes() } else { 0 }
    }
}

impl MotionPlan {
    /// How often the sampling head runs.
    pub(crate) fn sampling_runs(&self) -> usize {
        self.shape.images.div_ceil(self.sampling_images)
    }

    /// Bytes of the field on the device.
    fn store_bytes(&self) -> u64 {
        if self.resident { self.shape.bytes() } else { 0 }
    }
}
