//! The stages that make geometry: the backbone over all images, then the head a few images at a time.

use omnix_geometry::{Camera, agreement, align_cameras, decode_pose_code, encode_pose_code, normalise_extrinsics};

use super::Session;
use super::handover::{BackboneResults, fill, inputs, part};
use super::motion::FieldBuilder;
use super::on_device::{OnDevice, PhasePart};
use super::readback::Results;
use crate::error::OmnixError;
use crate::event::{Event, Listener, Phase, ResidentGeometry};

impl Session {
    /// Features on the device and cameras.
    pub(super) async fn run_backbone(&mut self, listener: Listener<'_>) -> Result<BackboneResults, OmnixError> {
        let (height, width) = (self.plan.request.height as u32, self.plan.request.width as u32);
        let given = self.plan.request.cameras.clone();
        if let Some(given) = &given {
            let poses: Vec<_> = given.iter().map(|c| c.extrinsics).collect();
            let normalised = normalise_extrinsics(&poses)?;
            let cameras = given.iter().zip(normalised).map(|(c, extrinsics)| Camera { extrinsics, ..*c });
            let codes: Vec<f32> = cameras.flat_map(|c| encode_pose_code(&c, height, width)).collect();
            self.backbone().await?.write("camera_codes", &codes)?;
        }
        let backbone = self.backbone().await?;
        let whole = PhasePart { phase: Phase::Backbone, before: 0, total: backbone.plan().flops() };
        backbone.run(whole, listener).await?;
        let codes = backbone.read_async("cam.pose_enc").await?;
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
            if let Some(agreement) = agreement(&poses(&given), &poses(&cameras), &aligned.similarity) {
                listener(Event::Agreement(agreement))?;
            }
            depth_scale = (1.0 / aligned.depth_divisor) as f32;
            for ((camera, given), extrinsics) in cameras.iter_mut().zip(&given).zip(aligned.extrinsics) {
                *camera = Camera { extrinsics, intrinsics: given.intrinsics };
            }
        }
        Ok(BackboneResults { features, cameras, depth_scale })
    }

    /// Each image's geometry to `results`, and what motion needs of it to `motion`.
    pub(super) async fn run_head(
        &mut self,
        made: &BackboneResults,
        mut motion: Option<&mut FieldBuilder>,
        listener: Listener<'_>,
        results: &mut Results,
    ) -> Result<(), OmnixError> {
        let (images, step) = (self.plan.request.images, self.plan.head_images);
        let runs = self.plan.head_runs();
        let bindings = inputs(&made.features, runs);
        let head = self.weights.stage(&self.plan.head, &bindings, listener).await?;
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
            run_between(&head, PhasePart { phase: Phase::Head, before, total }, listener, results).await?;
            for i in 0..count {
                let part = |name: &str| part(&head, name, i, step);
                if let Some(motion) = &mut motion {
                    motion.take_head(first + i, &part).await?;
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
                results.done(geometry, listener).await?;
            }
        }
        results.finish(listener).await
    }
}

/// Runs the head on a few images, and hands out the results of those before in the meantime. Where the listener breaks off, what was
/// computed by then is still told.
async fn run_between(
    head: &OnDevice,
    part: PhasePart,
    listener: Listener<'_>,
    results: &mut Results,
) -> Result<(), OmnixError> {
    let mut run = head.start();
    while let Some(step) = run.step().await? {
        results.between(listener).await?;
        if let Err(error) = part.tell(step.done, listener) {
            run.stop().await?;
            if matches!(error, OmnixError::Interrupted) {
                results.finish(listener).await?;
            }
            return Err(error);
        }
    }
    Ok(())
}
