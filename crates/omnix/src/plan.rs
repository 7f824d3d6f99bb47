//! A whole run planned: two graphs, their chunks and the bytes they take, with no device.

use omnix_graph::{Graph, GraphError, Plan, PlanOptions};
use omnix_kernels::{Caps, Tier};
use omnix_model::{BackboneSpec, HeadSpec};
use serde::Serialize;

use crate::error::OmnixError;
use crate::request::Request;
use crate::weights::Weights;

/// Everything a run will do.
#[derive(Clone, Debug)]
pub struct RunPlan {
    /// What was asked.
    pub request: Request,
    /// The network over all images: features and cameras.
    pub backbone: Plan,
    /// Depth (and rays) of a few images.
    pub head: Plan,
    /// How many.
    pub head_images: usize,
    /// Bytes of the features and cameras that stay between the two.
    kept: u64,
}

/// A plan in numbers, for people and machines.
#[derive(Clone, Debug, Serialize)]
pub struct PlanSummary {
    /// Number of images.
    pub images: usize,
    /// Rows and columns of an image.
    pub image_size: [usize; 2],
    /// Tokens of all images.
    pub tokens: usize,
    /// Bytes of device memory at the peak.
    pub peak_bytes: u64,
    /// Of these, weights.
    pub weight_bytes: u64,
    /// Bytes of images, features and intermediates while the backbone runs.
    pub backbone_bytes: u64,
    /// Bytes of features, intermediates and results while the head runs.
    pub head_bytes: u64,
    /// Operations of the backbone (a multiply-add is two).
    pub backbone_flops: u64,
    /// Operations of the head over all images.
    pub head_flops: u64,
    /// Parts into which row-wise work of the backbone is cut.
    pub backbone_parts: usize,
    /// Rows of a chunk in each kind of chain.
    pub chunk_rows: Vec<usize>,
    /// Images through the head at a time.
    pub head_images: usize,
}

/// Staging for reading results back, and parameters of dispatches: a small, bounded extra.
const OVERHEAD: u64 = 4 << 20;

impl RunPlan {
    /// Plans `request` for a device with `caps`.
    ///
    /// # Errors
    /// [`OmnixError::Budget`] with the least that works, or what is wrong with the request.
    pub fn new(weights: &Weights, request: &Request, caps: &Caps) -> Result<Self, OmnixError> {
        request.check()?;
        let network = weights.network();
        let mut graph = Graph::new();
        network.backbone(&mut graph, &backbone_spec(weights, request))?;
        let options = PlanOptions { storage: request.storage, parts: request.parts, ..PlanOptions::default() };
        let free = Plan::new(&graph, caps, &PlanOptions { budget: Some(u64::MAX), ..options });
        let mut head_images =
            request.head_images.unwrap_or(if caps.tier == Tier::Gpu { 4 } else { 1 }).clamp(1, request.images);
        let mut head = plan_head(weights, request, caps, head_images)?;
        let plan = match (free, request.budget) {
            (Ok(plan), None) => plan,
            (Err(error), None) => return Err(error.into()),
            (free, Some(budget)) => {
                let kept = kept_bytes(&graph);
                let key_bytes = |plan: &Plan| plan.weight_bytes();
                let backbone_weights = match &free {
                    Ok(plan) => key_bytes(plan),
                    Err(_) => 0,
                };
                let fixed = backbone_weights + head.weight_bytes() + OVERHEAD;
                while head_images > 1 && fixed + kept + head_total(&head) > budget {
                    head_images -= 1;
                    head = plan_head(weights, request, caps, head_images)?;
                }
                let least_head = fixed + kept + head_total(&head);
                let room = budget.saturating_sub(fixed);
                match Plan::new(&graph, caps, &PlanOptions { budget: Some(room), ..options }) {
                    Ok(plan) if least_head <= budget => plan,
                    Ok(_) => return Err(too_small(budget, least_head)),
                    Err(GraphError::Budget { least, .. }) => {
                        return Err(too_small(budget, (fixed + least).max(least_head)));
                    }
                    Err(error) => return Err(error.into()),
                }
            }
        };
        Ok(Self { request: request.clone(), kept: kept_bytes(&graph), backbone: plan, head, head_images })
    }

    /// Bytes of all weights.
    #[must_use]
    pub fn weight_bytes(&self) -> u64 {
        self.backbone.weight_bytes() + self.head.weight_bytes()
    }

    /// Bytes of device memory at the peak of the run.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        self.weight_bytes() + OVERHEAD + self.backbone.working_bytes().max(self.kept + head_total(&self.head))
    }

    /// Operations of the whole run.
    #[must_use]
    pub fn flops(&self) -> u64 {
        self.backbone.flops() + self.head_flops()
    }

    /// Operations of the head over all images.
    #[must_use]
    pub fn head_flops(&self) -> u64 {
        self.head.flops() * self.request.images.div_ceil(self.head_images) as u64
    }

    /// The plan in numbers.
    #[must_use]
    pub fn summary(&self) -> PlanSummary {
        let (gh, gw) = self.request.grid();
        let mut chunk_rows: Vec<usize> = self.backbone.chunks().into_iter().map(|(_, _, rows)| rows).collect();
        chunk_rows.sort_unstable();
        chunk_rows.dedup();
        PlanSummary {
            images: self.request.images,
            image_size: [self.request.height, self.request.width],
            tokens: self.request.images * (gh * gw + 1),
            peak_bytes: self.peak_bytes(),
            weight_bytes: self.weight_bytes(),
            backbone_bytes: self.backbone.working_bytes(),
            head_bytes: self.kept + head_total(&self.head),
            backbone_flops: self.backbone.flops(),
            head_flops: self.head_flops(),
            backbone_parts: self.backbone.parts,
            chunk_rows,
            head_images: self.head_images,
        }
    }
}

fn too_small(budget: u64, least: u64) -> OmnixError {
    OmnixError::Budget {
        budget,
        least,
        hint: "fewer images with --frames, smaller ones with --process-res or --size, or --weights-type f16 or i8",
    }
}

/// Working memory of the head and the staging its results are read through.
fn head_total(head: &Plan) -> u64 {
    let results: u64 = head.graph.outputs().iter().map(|v| head.graph.shape(*v).bytes()).sum();
    head.working_bytes() + results
}

/// Bytes of the backbone's outputs.
fn kept_bytes(graph: &Graph) -> u64 {
    graph.outputs().iter().map(|v| graph.shape(*v).bytes()).sum()
}

pub(crate) fn backbone_spec(weights: &Weights, request: &Request) -> BackboneSpec {
    BackboneSpec {
        images: request.images,
        grid: request.grid(),
        reference: request.reference.unwrap_or_else(|| weights.network().default_reference()),
        cameras_given: request.cameras.is_some(),
        times: request.times.clone(),
        export_layers: Vec::new(),
    }
}

fn plan_head(weights: &Weights, request: &Request, caps: &Caps, frames: usize) -> Result<Plan, OmnixError> {
    let mut graph = Graph::new();
    weights.network().head(&mut graph, &HeadSpec { frames, grid: request.grid(), rays: request.rays })?;
    let options = PlanOptions { storage: request.storage, ..PlanOptions::default() };
    Ok(Plan::new(&graph, caps, &options)?)
}
