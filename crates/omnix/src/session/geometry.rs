//! The stages that make geometry: the backbone over all images, then the head a few images at a time.

use omnix_geometry::{Camera, align_cameras, decode_pose_code, encode_pose_code, normalise_extrinsics};
use omnix_graph::GraphError;

use super::Session;
use super::handover::{BackboneResults, fill, inputs, part};
use super::motion::FieldBuilder;
use super::readback::Results;
use crate::error::OmnixError;
use crate::event::{Listener, Phase, ResidentGeometry, Teller};

impl Session {
    /// Features on the device and cameras.
    pub(super) fn run_backbone(&mut self, listener: Listener<'_>) -> Result<BackboneResults, OmnixError> {
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
        let mut teller = Teller::new(listener);
        let ran = backbone.run(&mut |done, total| teller.progress(Phase::Backbone, done, total));
        teller.end(ran)?;
        let codes = backbone.read("cam.pose_enc")?;
        let predicted =
            codes.chunks_exact(9).map(|code| decode_pose_code(std::array::from_fn(|i| code[i]), height, width));
        let mut cameras: Vec<Camera> = predicted.collect();
        let features = (0..4).map(|k| backbone.slice(&format!("feat.{k}"))).collect::<Result<Vec<_>, _>>()?;
        // The arena goes back, and the images with it; the features' own buffers live on in the slices.
        self.backbone = None;
        self.written.fill(false);
        let mut depth_scale = 1.0;
        if let Some(given) = given {
            let poses = |cameras: &[Camera]| cameras.iter().map(|c| c.extrinsics).collect::<Vec<_>>();
            let aligned = align_cameras(&poses(&given), &poses(&cameras), self.plan.request.align)?;
            depth_scale = (1.0 / aligned.depth_divisor) as f32;
            for ((camera, given), extrinsics) in cameras.iter_mut().zip(&given).zip(aligned.extrinsics) {
                *camera = Camera { extrinsics, intrinsics: given.intrinsics };
            }
        }
        Ok(BackboneResults { features, cameras, depth_scale })
    }

    /// Each image's geometry to `results`, and what motion needs of it to `motion`.
    pub(super) fn run_head(
        &mut self,
        made: &BackboneResults,
        mut motion: Option<&mut FieldBuilder>,
        listener: Listener<'_>,
        results: &mut dyn Results,
    ) -> Result<(), OmnixError> {
        let (images, step) = (self.plan.request.images, self.plan.head_images);
        let runs = self.plan.head_runs();
        let bindings = inputs(&made.features, runs);
        let head = self.weights.stage(&self.plan.head, &bindings, listener)?;
        let total = self.plan.head_flops();
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            if runs > 1 {
                fill(self.engine.gpu(), &head, &made.features, (first, count, images))?;
            }
            if let Some(motion) = &motion {
                motion.fill_head(&head, &made.cameras, first, count)?;
            }
            let before = head.plan().flops() * (first / step) as u64;
            let mut teller = Teller::new(listener);
            let ran = head.run(&mut |done, _| {
                teller.with(|listener| results.between(listener))?;
                teller.progress(Phase::Head, before + done, total)
            });
            let stopped = matches!(ran, Err(GraphError::Interrupted));
            let ran = teller.end(ran);
            if stopped && matches!(ran, Err(OmnixError::Interrupted)) {
                results.finish(listener)?;
            }
            ran?;
            for i in 0..count {
                let part = |name: &str| part(&head, name, i, step);
                if let Some(motion) = &mut motion {
                    motion.take_head(first + i, &part)?;
                }
                let rays = if self.plan.request.rays { Some((part("ray")?, part("ray_conf")?)) } else { None };
                let geometry = ResidentGeometry {
                    index: first + i,
                    depth: part("depth")?,
                    confidence: part("depth_conf")?,
                    camera: made.cameras[first + i],
                    depth_scale: made.depth_scale,
                    rays,
                    points: motion.as_ref().map(|_| part("points")).transpose()?,
                };
                results.done(geometry, listener)?;
            }
        }
        results.finish(listener)
    }
}
