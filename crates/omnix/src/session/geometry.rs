//! The stages that make geometry: the backbone over all images, then the head a few images at a time.

use omnix_geometry::{
    Camera, RayMaps, agreement, align_cameras, cameras_from_rays, decode_pose_code, encode_pose_code,
    normalise_extrinsics,
};
use omnix_kernels::readback::read_async;

use super::Session;
use super::handover::{BackboneResults, fill, inputs, part, places};
use super::motion::FieldBuilder;
use super::on_device::{OnDevice, PhasePart};
use super::readback::Results;
use super::{masked, scaled};
use crate::error::OmnixError;
use crate::event::{Event, FrameGeometry, Listener, Phase, ResidentGeometry};
use crate::plan::feature_name;
use crate::request::KnownDistance;

impl Session {
    /// Features on the device and cameras.
    pub(super) async fn run_backbone(&mut self, listener: Listener<'_>) -> Result<BackboneResults, OmnixError> {
        let (height, width) = (self.plan.request.height as u32, self.plan.request.width as u32);
        let config = self.weights.checkpoint().network().config();
        let (feeds, predicts) = (self.plan.request.feeds_cameras(config), config.makes_cameras());
        let given = self.plan.request.cameras.clone().filter(|_| feeds);
        if let Some(given) = &given {
            let poses: Vec<_> = given.iter().map(|c| c.extrinsics).collect();
            let normalised = normalise_extrinsics(&poses)?;
            let cameras = given.iter().zip(normalised).map(|(c, extrinsics)| Camera { extrinsics, ..*c });
            let codes: Vec<f32> = cameras.flat_map(|c| encode_pose_code(&c, height, width)).collect();
            self.backbone().await?.write("camera_codes", &codes)?;
        }
        let (blocks, images, gpu) =
            (self.plan.request.features.clone(), self.plan.request.images, self.engine.gpu().clone());
        let first_view = self.plan.first_view.or_else(|| blocks.is_empty().then_some(0));
        let backbone = self.backbone().await?;
        let whole = PhasePart { phase: Phase::Backbone, before: 0, total: backbone.plan().flops() };
        backbone.run(whole, listener).await?;
        let codes = if predicts { backbone.read_async("cam.pose_enc").await? } else { Vec::new() };
        let predicted =
            codes.chunks_exact(9).map(|code| decode_pose_code(std::array::from_fn(|i| code[i]), height, width));
        let cameras: Vec<Camera> = predicted.collect();
        let features = (0..4).map(|k| backbone.slice(&format!("feat.{k}"))).collect::<Result<Vec<_>, _>>()?;
        let export = |block: &usize| Ok((*block, backbone.slice(&feature_name(*block))?));
        let exports = blocks.iter().map(export).collect::<Result<Vec<_>, OmnixError>>()?;
        let first = match first_view {
            Some(view) => view,
            None => read_async::<u32>(&gpu, &backbone.slice("ref.index")?).await?[0] as usize,
        };
        let places = places(images, first);
        // The arena goes back, and the images with it; the features' own buffers live on in the slices.
        self.backbone = None;
        self.written.fill(false);
        // A head that makes Gaussians looks at them again.
        let pictures = self.shared.take().filter(|_| self.plan.request.gaussians);
        Ok(BackboneResults { features, pictures, exports, places, cameras, depth_scale: 1.0 })
    }

    /// Brings predicted cameras and known ones together, where some are given.
    pub(super) fn align(&self, made: &mut BackboneResults, listener: Listener<'_>) -> Result<(), OmnixError> {
        let config = self.weights.checkpoint().network().config();
        let Some(given) = self.plan.request.cameras.as_ref().filter(|_| self.plan.request.feeds_cameras(config)) else {
            return Ok(());
        };
        let poses = |cameras: &[Camera]| cameras.iter().map(|c| c.extrinsics).collect::<Vec<_>>();
        let aligned = align_cameras(&poses(given), &poses(&made.cameras), self.plan.request.align)?;
        if let Some(agreement) = agreement(&poses(given), &poses(&made.cameras), &aligned.similarity) {
            listener(Event::Agreement(agreement))?;
        }
        made.depth_scale = (1.0 / aligned.depth_divisor) as f32;
        for ((camera, given), extrinsics) in made.cameras.iter_mut().zip(given).zip(aligned.extrinsics) {
            *camera = Camera { extrinsics, intrinsics: given.intrinsics };
        }
        Ok(())
    }

    /// Each image's geometry to `results`, and what motion needs of it to `motion`. Returns metres in a unit of these, where a distance is
    /// known.
    pub(super) async fn run_head(
        &mut self,
        made: &BackboneResults,
        mut motion: Option<&mut FieldBuilder>,
        listener: Listener<'_>,
        results: &mut Results,
    ) -> Result<Option<f64>, OmnixError> {
        let (images, step) = (self.plan.request.images, self.plan.head_images);
        let runs = self.plan.head_runs();
        let bindings = inputs(&made.features, made.pictures.as_ref(), runs);
        let head = self.weights.stage(&self.plan.head, &bindings, listener).await?;
        let total = self.plan.head_flops();
        let fill_in = |first: usize, motion: Option<&FieldBuilder>| {
            let count = step.min(images - first);
            if runs > 1 {
                let seen = (&made.features[..], made.pictures.as_ref());
                fill(self.engine.gpu(), &head, seen, (first, count, images))?;
            }
            motion.map_or(Ok(()), |motion| motion.fill_head(&head, &made.cameras, first, count))
        };
        let mut scale = None;
        if let Some(known) = self.plan.request.distance {
            // The image that shows the distance comes first, for its depth alone.
            let first = known.image / step * step;
            fill_in(first, motion.as_deref())?;
            run_between(&head, PhasePart { phase: Phase::Head, before: 0, total }, listener, results).await?;
            let metres = self.known_scale(&known, &head, made, step).await?;
            listener(Event::MetricScale(metres))?;
            scale = Some(metres);
        }
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            fill_in(first, motion.as_deref())?;
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
                    confidence: Some(part("depth_conf")?),
                    sky: None,
                    camera: Some(made.cameras[first + i]),
                    depth_scale: made.depth_scale,
                    rays,
                    features: made.exports_of(first + i),
                    gaussians: if self.plan.request.gaussians { Some(part("gaussians")?) } else { None },
                    points: motion.as_ref().map(|_| part("points")).transpose()?,
                };
                results.done(geometry, listener).await?;
            }
        }
        results.finish(listener).await?;
        Ok(scale)
    }

    /// Metres in a unit of the network, from the head's results for the image that shows a known distance.
    async fn known_scale(
        &self,
        known: &KnownDistance,
        head: &OnDevice,
        made: &BackboneResults,
        step: usize,
    ) -> Result<f64, OmnixError> {
        let (image, place, gpu) = (known.image, known.image % step, self.engine.gpu());
        let request = &self.plan.request;
        let map = |name: &str| part(head, name, place, step);
        let mut frame = FrameGeometry {
            index: image,
            depth: read_async(gpu, &map("depth")?).await?,
            confidence: None,
            sky: None,
            camera: Some(made.cameras[image]),
            rays: None,
            gaussians: None,
            features: Vec::new(),
        };
        if request.rays {
            frame.rays = Some((read_async(gpu, &map("ray")?).await?, read_async(gpu, &map("ray_conf")?).await?));
        }
        masked::geometry(&mut frame, request.masks.as_deref(), request.grid());
        let mut camera = made.cameras[image];
        if let Some((rays, confidence)) = &frame.rays {
            let (rows, columns) = request.grid();
            let maps = RayMaps { rays, confidence, size: [8 * rows, 8 * columns] };
            let found = cameras_from_rays(&maps, [request.height as u32, request.width as u32], None)?;
            camera = found.first().map_or(camera, |found| found.camera);
        }
        scaled::scale(known, &frame.depth, request.width, &camera)
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
