//! A plan in numbers, for people and machines.

use omnix_graph::Plan;
use serde::Serialize;

use super::{OVERHEAD, RunPlan, stages};

/// A plan in numbers.
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
    /// Bytes of host memory for maps that wait until all images are done.
    pub host_bytes: u64,
    /// Bytes of all weights.
    pub weight_bytes: u64,
    /// Operations of the whole run (a multiply-add is two).
    pub flops: u64,
    /// The stages in the order in which they run.
    pub stages: Vec<StageSummary>,
    /// What trajectories are evaluated from, if they are wanted.
    pub field: Option<FieldSummary>,
}

/// One stage of a run.
#[derive(Clone, Debug, Serialize)]
pub struct StageSummary {
    /// metric backbone, metric head, backbone, head, motion, sampling, evaluation.
    pub name: &'static str,
    /// Bytes of device memory while it runs.
    pub bytes: u64,
    /// Of these, weights.
    pub weight_bytes: u64,
    /// Operations over all images; those of the evaluation are for one image at all times.
    pub flops: u64,
    /// Images that go through it at a time.
    pub images: usize,
    /// Parts into which row-wise work is cut.
    pub parts: usize,
    /// Rows of a chunk in each kind of chain.
    pub chunk_rows: Vec<usize>,
}

/// The field of a run.
#[derive(Clone, Debug, Serialize)]
pub struct FieldSummary {
    /// Bytes of the field, offsets, weights and points of all images.
    pub bytes: u64,
    /// Whether it is kept on the device; else in a file beside the results.
    pub on_device: bool,
    /// Pixels and target times that are evaluated at a time.
    pub chunk: [usize; 2],
}

impl RunPlan {
    /// The stages in the order in which they run.
    #[must_use]
    pub fn stages(&self) -> Vec<StageSummary> {
        let images = self.request.images;
        let weights = |own: u64| if self.request.keep_weights { self.weight_bytes() } else { own };
        let stage = |name, plan: &Plan, held: u64, count: usize| {
            let runs = images.div_ceil(count);
            let weight_bytes = weights(plan.resident_weight_bytes());
            let mut chunk_rows: Vec<usize> = plan.chunks().into_iter().map(|(_, _, rows)| rows).collect();
            chunk_rows.sort_unstable();
            chunk_rows.dedup();
            StageSummary {
                name,
                bytes: weight_bytes + OVERHEAD + plan.working_bytes() + held,
                weight_bytes,
                flops: plan.flops() * runs as u64,
                images: count,
                parts: plan.parts,
                chunk_rows,
            }
        };
        let mut stages = Vec::new();
        if let Some(metric) = &self.metric {
            let held =
                stages::metric_head_held(&metric.head, metric.head_runs(images), metric.kept, self.shared_images());
            stages.push(stage("metric backbone", &metric.backbone, 0, images));
            stages.push(stage("metric head", &metric.head, held, metric.head_images));
        }
        stages.push(stage("backbone", &self.backbone, 0, images));
        let field = self.motion.as_ref().map(|m| (&m.shape, m.resident));
        let tokens = self.motion.as_ref().map_or(0, |m| m.token_bytes);
        stages.push(stage(
            "head",
            &self.head,
            stages::head_held(&self.head, self.head_runs(), self.kept + self.head_images_held(), tokens, field)
                + stages::staged_features(&self.backbone.graph, &self.head, &self.request),
            self.head_images,
        ));
        if let Some(motion) = &self.motion {
            let place = (&motion.shape, motion.resident);
            stages.push(stage("motion", &motion.module, stages::module_held(&motion.module, self.kept, place), images));
            let held = stages::sampling_held(&motion.sampling, motion.sampling_runs(), self.kept, place, &self.request);
            stages.push(stage("sampling", &motion.sampling, held, motion.sampling_images));
            let weight_bytes = weights(0);
            stages.push(StageSummary {
                name: "evaluation",
                bytes: weight_bytes + OVERHEAD + motion.store_bytes() + motion.evaluation_bytes,
                weight_bytes,
                flops: motion.shape.evaluation_flops(),
                images: 1,
                parts: motion.shape.pixels().div_ceil(motion.evaluation.pixels)
                    * motion.shape.images.div_ceil(motion.evaluation.times),
                chunk_rows: vec![motion.evaluation.pixels],
            });
        }
        stages
    }

    /// The plan in numbers.
    #[must_use]
    pub fn summary(&self) -> PlanSummary {
        let (gh, gw) = self.request.grid();
        PlanSummary {
            images: self.request.images,
            image_size: [self.request.height, self.request.width],
            tokens: self.request.images * (gh * gw + 1),
            peak_bytes: self.peak_bytes(),
            host_bytes: self.host_bytes(),
            weight_bytes: self.weight_bytes(),
            flops: self.flops(),
            stages: self.stages(),
            field: self.motion.as_ref().map(|m| FieldSummary {
                bytes: m.shape.bytes(),
                on_device: m.resident,
                chunk: [m.evaluation.pixels, m.evaluation.times],
            }),
        }
    }
}
