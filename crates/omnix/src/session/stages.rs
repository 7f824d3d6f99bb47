//! The stages that make geometry: the backbone over all images, then the head a few images at a time.

use std::ops::ControlFlow;

use omnix_geometry::{Camera, align_cameras, decode_pose_code, encode_pose_code, normalise_extrinsics};
use omnix_graph::{Bindings, GraphError, Tensors};
use omnix_kernels::BufferSlice;

use super::motion::Making;
use super::readback::Results;
use super::{Listener, ResidentGeometry, Session};
use crate::error::OmnixError;
use crate::progress::{Phase, Progress};

/// What the backbone leaves for the other stages.
pub(super) struct Kept {
    /// `feat.0` to `feat.3` of all images, on the device.
    pub(super) features: Vec<BufferSlice>,
    /// In the world of the results.
    pub(super) cameras: Vec<Camera>,
    /// What depth is multiplied by to fit given cameras.
    pub(super) depth_scale: f32,
}

impl Session {
    /// Features on the device and cameras.
    pub(super) fn run_backbone(&mut self, progress: Listener<'_>) -> Result<Kept, OmnixError> {
        let (height, width) = (self.plan.request.height as u32, self.plan.request.width as u32);
        let given = self.plan.request.cameras.clone();
        if let Some(given) = &given {
            let poses: Vec<_> = given.iter().map(|c| c.extrinsics).collect();
            let normalised = normalise_extrinsics(&poses)?;
            let cameras = given.iter().zip(normalised).map(|(c, extrinsics)| Camera { extrinsics, ..*c });
            let codes: Vec<f32> = cameras.flat_map(|c| encode_pose_code(&c, height, width)).collect();
            self.backbone()?.write("camera_codes", &codes)?;
        }
        let backbone = self.backbone()?;
        backbone.run(&mut |done, total| progress(Progress { phase: Phase::Backbone, done, total }))?;
        let codes = backbone.read("cam.pose_enc")?;
        let predicted =
            codes.chunks_exact(9).map(|code| decode_pose_code(std::array::from_fn(|i| code[i]), height, width));
        let mut cameras: Vec<Camera> = predicted.collect();
        let features = (0..4).map(|k| backbone.slice(&format!("feat.{k}"))).collect::<Result<Vec<_>, _>>()?;
        // The arena goes back; the features' own buffers live on in the slices.
        self.backbone = None;
        let mut depth_scale = 1.0;
        if let Some(given) = given {
            let poses = |cameras: &[Camera]| cameras.iter().map(|c| c.extrinsics).collect::<Vec<_>>();
            let aligned = align_cameras(&poses(&given), &poses(&cameras), self.plan.request.align)?;
            depth_scale = (1.0 / aligned.depth_divisor) as f32;
            for ((camera, given), extrinsics) in cameras.iter_mut().zip(&given).zip(aligned.extrinsics) {
                *camera = Camera { extrinsics, intrinsics: given.intrinsics };
            }
        }
        Ok(Kept { features, cameras, depth_scale })
    }

    /// Each image's geometry to `results`, and what motion needs of it to `motion`.
    pub(super) fn run_head(
        &mut self,
        kept: &Kept,
        mut motion: Option<&mut Making>,
        progress: Listener<'_>,
        results: &mut dyn Results,
    ) -> Result<(), OmnixError> {
        let (images, step) = (self.plan.request.images, self.plan.head_images);
        let runs = self.plan.head_runs();
        let bindings = inputs(&kept.features, runs);
        let head = self.weights.stage(&self.plan.head, &bindings, progress)?;
        let total = self.plan.head_flops();
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            if runs > 1 {
                self.fill(&head, &kept.features, first, count)?;
            }
            if let Some(motion) = &motion {
                motion.fill_head(&head, &kept.cameras, first, count)?;
            }
            let before = head.plan().flops() * (first / step) as u64;
            let mut handed_out = Ok(());
            let ran = head.run(&mut |done, _| {
                handed_out = results.between();
                if handed_out.is_err() {
                    return ControlFlow::Break(());
                }
                progress(Progress { phase: Phase::Head, done: before + done, total })
            });
            handed_out?;
            if matches!(ran, Err(GraphError::Interrupted)) {
                results.finish()?;
            }
            ran?;
            for i in 0..count {
                let part = |name: &str| part(&head, name, i, step);
                if let Some(motion) = &mut motion {
                    motion.take_head(first + i, &part)?;
                }
                let rays = if self.plan.request.rays { Some((part("ray")?, part("ray_conf")?)) } else { None };
                results.done(ResidentGeometry {
                    index: first + i,
                    depth: part("depth")?,
                    confidence: part("depth_conf")?,
                    camera: kept.cameras[first + i],
                    depth_scale: kept.depth_scale,
                    rays,
                    points: motion.as_ref().map(|_| part("points")).transpose()?,
                })?;
            }
        }
        results.finish()
    }

    /// Copies the features of images `first..first + count` into the inputs of a stage over a few images.
    pub(super) fn fill(
        &self,
        stage: &Tensors,
        features: &[BufferSlice],
        first: usize,
        count: usize,
    ) -> Result<(), OmnixError> {
        let gpu = self.engine.gpu();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (k, feature) in features.iter().enumerate() {
            let input = stage.slice(&format!("feat.{k}"))?;
            let image = feature.size / self.plan.request.images as u64;
            let from = feature.offset + first as u64 * image;
            encoder.copy_buffer_to_buffer(&feature.buffer, from, &input.buffer, input.offset, count as u64 * image);
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}

/// The features as inputs of a stage that runs so often: more than one run gets copies of its images' own.
pub(super) fn inputs(features: &[BufferSlice], runs: usize) -> Bindings {
    let named = features.iter().enumerate().map(|(k, feature)| (format!("feat.{k}"), feature.clone()));
    if runs == 1 { named.collect() } else { Bindings::default() }
}

/// Part `i` of `count` equal ones of an input or output.
pub(super) fn part(stage: &Tensors, name: &str, i: usize, count: usize) -> Result<BufferSlice, OmnixError> {
    let all = stage.slice(name)?;
    let size = all.size / count as u64;
    Ok(BufferSlice { offset: all.offset + i as u64 * size, size, buffer: all.buffer })
}
