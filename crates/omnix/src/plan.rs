//! A whole run planned: up to four graphs, their chunks and the bytes they take, with no device.
//!
//! Stages, one after another: in a nested network its metric network's backbone and head; the backbone over all images; the head, a
//! few images at a time; and, where trajectories are wanted, the trajectory module over all images, the sampling head a few images
//! at a time, and the evaluation of the field.
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
    /// The metric network of a nested one, which runs first.
    pub metric: Option<MetricPlan>,
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
    /// Numbers of a pixel, and of a cell of the ray maps, that wait on the host until all images are done.
    waiting: [u64; 2],
    /// Unit of length of the results.
    unit: &'static str,
    /// The view that is first inside the encoder, where the network does not choose it.
    pub(crate) first_view: Option<usize>,
}

/// The metric network of a nested one: metres and sky for the results of the other. Its maps wait on the host.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MetricPlan {
    /// The network over all images, each by itself: features.
    pub backbone: Plan,
    /// Depth and sky of a few images.
    pub head: Plan,
    /// How many.
    pub head_images: usize,
    /// Bytes of the features that stay between the two.
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

    /// Channels of the encoder's features, where some are wanted.
    #[must_use]
    pub fn feature_channels(&self) -> u64 {
        let graph = &self.backbone.graph;
        let found = self.request.features.first().and_then(|block| graph.find(&feature_name(*block)));
        found.map_or(0, |value| graph.shape(value).width() as u64)
    }

    /// Unit of length of the results: depth and positions, as files say it.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.unit
    }

    /// Bytes of host memory for maps that wait until all images are done: of networks whose results depend on the sky of all of them.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        host_bytes(&self.request, self.waiting)
    }

    /// Whether all images must be done before the first result is known.
    pub(crate) fn waits(&self) -> bool {
        self.waiting != [0, 0]
    }

    /// Bytes of the images on the device between the stages, where more than one of them sees them: both networks of a nested one, or
    /// the head that makes Gaussians.
    pub(crate) fn shared_images(&self) -> u64 {
        if self.metric.is_some() || self.request.gaussians { image_bytes(&self.request) } else { 0 }
    }

    /// Of these, what is there while the head runs.
    fn head_images_held(&self) -> u64 {
        if self.request.gaussians { image_bytes(&self.request) } else { 0 }
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
        let images = self.request.images;
        let metric = self.metric.iter().flat_map(move |m| [(&m.backbone, 1), (&m.head, m.head_runs(images) as u64)]);
        metric.chain([(&self.backbone, 1), (&self.head, self.head_runs() as u64)]).chain(motion)
    }

    /// Bytes of the weights that are on the device when no stage runs.
    fn resting_weights(&self) -> u64 {
        if self.request.keep_weights { self.weight_bytes() } else { 0 }
    }
}

impl MetricPlan {
    /// How often the head runs.
    pub(crate) fn head_runs(&self, images: usize) -> usize {
        images.div_ceil(self.head_images)
    }
}

/// Bytes of a number of values for each pixel, and of each cell of the ray maps.
fn host_bytes(request: &Request, [of_pixel, of_ray]: [u64; 2]) -> u64 {
    let (gh, gw) = request.grid();
    let (pixels, rays) = ((request.height * request.width) as u64, 64 * (gh * gw) as u64);
    (pixels * of_pixel + rays * of_ray) * 4 * request.images as u64
}

/// What the backbone calls the features after a block.
pub(crate) fn feature_name(block: usize) -> String {
    format!("out.aux.feat_layer_{block}")
}

/// Bytes of a request's images on the device.
fn image_bytes(request: &Request) -> u64 {
    12 * (request.images * request.height * request.width) as u64
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
