//! The stages that make a field: the trajectory module over all images, then the sampling head a few images at a time.

use omnix_geometry::{Camera, corner_rays};
use omnix_graph::Tensors;
use omnix_graph::ops::Motion;
use omnix_kernels::readback::read_async;
use omnix_kernels::{BufferSlice, Gpu};
use omnix_model::FORCED;

use super::Session;
use super::handover::{BackboneResults, fill, inputs, part};
use super::masked::{self, PixelParts, forced_scores};
use super::on_device::PhasePart;
use crate::error::OmnixError;
use crate::event::{Event, FrameMotion, Listener, Phase};
use crate::field::{About, Field, FieldImage, FieldShape, ImageMaps, Maps, Part, Store, copy, motion_of};
use crate::masks::Masks;
#[cfg(feature = "io")]
use crate::request::FieldPlace;

/// A field while it is made.
pub(super) struct FieldBuilder {
    gpu: Gpu,
    shape: FieldShape,
    motion: Motion,
    store: Store,
    /// `[images, cells, width]`: tokens of points that the head makes for the module, if it takes any.
    tokens: Option<BufferSlice>,
}

const TOKENS: &str = "traj.point_tokens";

impl FieldBuilder {
    /// Gives the head the rays of the images' corners, where it makes points of them.
    pub(super) fn fill_head(
        &self,
        head: &Tensors,
        cameras: &[Camera],
        first: usize,
        count: usize,
    ) -> Result<(), OmnixError> {
        if head.plan().graph.find("camera_rays").is_none() {
            return Ok(());
        }
        let mut corners = Vec::with_capacity(24 * count);
        for camera in &cameras[first..first + count] {
            corners.extend(corner_rays(camera, [self.shape.height, self.shape.width])?);
        }
        Ok(head.write_at("camera_rays", 0, &corners)?)
    }

    /// Takes an image's points and tokens from the head's outputs.
    pub(super) async fn take_head(
        &mut self,
        image: usize,
        output: &dyn Fn(&str) -> Result<BufferSlice, OmnixError>,
    ) -> Result<(), OmnixError> {
        self.store.put(image, Part::Points, &output("points")?).await?;
        if let Some(tokens) = &self.tokens {
            let from = output(TOKENS)?;
            let offset = tokens.offset + image as u64 * from.size;
            copy(&self.gpu, &from, &BufferSlice { offset, ..tokens.clone() });
        }
        Ok(())
    }
}

impl FieldBuilder {
    /// Changes what masks say of an image's pixels.
    async fn mask(&mut self, masks: Option<&Masks>, image: usize, confidence: &mut [f32]) -> Result<(), OmnixError> {
        let Some(masks) = masks else { return Ok(()) };
        let mask = self.store.numbers(image, Part::Mask).await?;
        let mut offsets = self.store.numbers(image, Part::Offsets).await?;
        let mut weights = self.store.numbers(image, Part::Weights).await?;
        let mut points = self.store.numbers(image, Part::Points).await?;
        let parts = PixelParts { offsets: &mut offsets, weights: &mut weights, points: &mut points, confidence };
        masked::field(masks, image, &self.shape, &mask, parts)?;
        for (part, numbers) in [(Part::Offsets, &offsets), (Part::Weights, &weights), (Part::Points, &points)] {
            self.store.replace(image, part, numbers)?;
        }
        Ok(())
    }
}

impl Session {
    /// Makes room for a field, if motion is wanted.
    pub(super) fn start_motion(&self) -> Result<Option<FieldBuilder>, OmnixError> {
        let Some(plan) = &self.plan.motion else { return Ok(None) };
        let gpu = self.engine.gpu();
        #[cfg(feature = "io")]
        let store = match &self.plan.request.field {
            _ if plan.resident => Store::device(gpu, plan.shape),
            FieldPlace::AutoIn(folder) | FieldPlace::Spool(folder) => Store::spool(gpu, plan.shape, folder)?,
            FieldPlace::Auto | FieldPlace::Device => Store::spool(gpu, plan.shape, &std::env::temp_dir())?,
        };
        // Planned so: there are no files.
        #[cfg(not(feature = "io"))]
        let store = Store::device(gpu, plan.shape);
        let graph = &plan.module.graph;
        let tokens = match graph.find(TOKENS) {
            Some(value) => {
                let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
                Some(gpu.buffer(TOKENS, graph.shape(value).bytes(), usage)?.into())
            }
            None => None,
        };
        let motion = motion_of(self.weights.checkpoint())?;
        if let Some(masks) = self.plan.request.said_masks() {
            masked::check(masks, motion)?;
        }
        Ok(Some(FieldBuilder { gpu: gpu.clone(), shape: plan.shape, motion, store, tokens }))
    }

    /// The field of all images.
    pub(super) async fn run_motion(
        &mut self,
        kept: BackboneResults,
        mut making: FieldBuilder,
        listener: Listener<'_>,
    ) -> Result<Field, OmnixError> {
        self.run_module(&kept, &mut making, listener).await?;
        let confidence = self.run_sampling(&kept, &mut making, listener).await?;
        let BackboneResults { features, cameras, .. } = kept;
        drop(features);
        self.engine.gpu().wait_async().await?;
        let times = self.plan.request.image_times();
        let images = cameras.into_iter().zip(times);
        let images = images.map(|(camera, (video, frame))| FieldImage { video, frame, time_s: None, camera });
        let maps = confidence.into_iter().map(|confidence| ImageMaps { confidence, ..ImageMaps::default() });
        let known = (images.collect(), Maps::Memory(maps.collect()));
        let weights = self.weights.checkpoint();
        let about = About {
            network: weights.network().config().name.clone(),
            weights: weights.checkpoint().name().to_owned(),
            unit: self.plan.unit().to_owned(),
            note: weights.note().map(str::to_owned),
            window: None,
        };
        let room = self.plan.evaluation_room();
        let FieldBuilder { shape, motion, store, .. } = making;
        let mut field = Field::new(&self.engine, (shape, motion), store, room, known, about);
        for index in 0..shape.images {
            field.score(index).await?;
            let (theta, confidence) = (field.theta(index)?.into_owned(), field.confidence(index)?.into_owned());
            listener(Event::Motion(FrameMotion { index, theta, confidence }))?;
        }
        Ok(field)
    }

    /// Field and mask of every image.
    async fn run_module(
        &mut self,
        kept: &BackboneResults,
        making: &mut FieldBuilder,
        listener: Listener<'_>,
    ) -> Result<(), OmnixError> {
        let Some(plan) = &self.plan.motion else { return Ok(()) };
        let mut bindings = inputs(&kept.features, None, 1);
        bindings.extend(making.tokens.take().map(|tokens| (TOKENS.to_owned(), tokens)));
        let module = self.weights.stage(&plan.module, &bindings, listener).await?;
        if let Some(masks) = self.plan.request.said_masks() {
            for (name, numbers) in FORCED.into_iter().zip(forced_scores(masks, &making.shape)) {
                module.write(name, &numbers)?;
            }
        }
        let whole = PhasePart { phase: Phase::Motion, before: 0, total: module.plan().flops() };
        module.run(whole, listener).await?;
        for image in 0..making.shape.images {
            for which in [Part::Field, Part::Mask] {
                let made = part(&module, which.name(), image, making.shape.images)?;
                making.store.put(image, which, &made).await?;
            }
        }
        self.engine.gpu().wait_async().await?;
        Ok(())
    }

    /// Offsets and weights of every image's pixels; their confidences.
    async fn run_sampling(
        &self,
        kept: &BackboneResults,
        making: &mut FieldBuilder,
        listener: Listener<'_>,
    ) -> Result<Vec<Vec<f32>>, OmnixError> {
        let Some(plan) = &self.plan.motion else { return Ok(Vec::new()) };
        let (images, step) = (self.plan.request.images, plan.sampling_images);
        let gpu = self.engine.gpu();
        let runs = plan.sampling_runs();
        let bindings = inputs(&kept.features, None, runs);
        let sampling = self.weights.stage(&plan.sampling, &bindings, listener).await?;
        let flops = sampling.plan().flops();
        let total = flops * runs as u64;
        let mut confidence = Vec::with_capacity(images);
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            if runs > 1 {
                fill(gpu, &sampling, (&kept.features[..], None), (first, count, images))?;
            }
            for i in 0..count {
                for which in [Part::Field, Part::Mask] {
                    making.store.give(first + i, which, &part(&sampling, which.name(), i, step)?).await?;
                }
            }
            let before = flops * (first / step) as u64;
            sampling.run(PhasePart { phase: Phase::Sampling, before, total }, listener).await?;
            for i in 0..count {
                for which in [Part::Offsets, Part::Weights] {
                    making.store.put(first + i, which, &part(&sampling, which.name(), i, step)?).await?;
                }
                let mut trust = read_async::<f32>(gpu, &part(&sampling, "traj_conf", i, step)?).await?;
                making.mask(self.plan.request.said_masks(), first + i, &mut trust).await?;
                confidence.push(trust);
            }
        }
        Ok(confidence)
    }
}
