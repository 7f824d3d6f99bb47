//! A run on a device: images in, then results image by image.

use std::ops::ControlFlow;

use omnix_geometry::{Camera, align_cameras, decode_pose_code, encode_pose_code, normalise_extrinsics};
use omnix_graph::exec::Bindings;
use omnix_graph::{Executable, WeightStore};
use omnix_kernels::BufferSlice;

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::plan::RunPlan;
use crate::progress::{Phase, Progress};
use crate::weights::Weights;

/// What was found out about one image.
#[derive(Clone, Debug)]
pub struct FrameGeometry {
    /// Index of the image.
    pub index: usize,
    /// Depth along the camera's z axis, `[height, width]`, in the network's own scale.
    pub depth: Vec<f32>,
    /// Confidence of each depth, at least 1.
    pub confidence: Vec<f32>,
    /// World-to-camera pose and intrinsics in pixels of the processed image.
    pub camera: Camera,
    /// `[8·height/14, 8·width/14, 6]` direction and origin in the world, and a confidence each, if asked for.
    pub rays: Option<(Vec<f32>, Vec<f32>)>,
}

/// What was found out about one image, on the device: f32, row-major, storage buffers that can also be copied from.
///
/// An image that is not the first of its chunk begins where its numbers do, which need not be a multiple of the binding
/// alignment: bind the whole buffer and pass the offset, or plan with `head_images: Some(1)`, where offsets are 0.
#[derive(Clone, Debug)]
pub struct ResidentGeometry {
    /// Index of the image.
    pub index: usize,
    /// Depth `[height, width]` before [`ResidentGeometry::depth_scale`].
    pub depth: BufferSlice,
    /// Confidence `[height, width]`.
    pub confidence: BufferSlice,
    /// World-to-camera pose and intrinsics in pixels of the processed image.
    pub camera: Camera,
    /// What depth is multiplied by: 1 unless cameras were given.
    pub depth_scale: f32,
    /// Rays and their confidence as in [`FrameGeometry::rays`], if asked for.
    pub rays: Option<(BufferSlice, BufferSlice)>,
}

/// A planned run with its memory on the device.
#[derive(Debug)]
pub struct Session {
    engine: Engine,
    plan: RunPlan,
    store: WeightStore,
    backbone: Option<Executable>,
    /// Bytes of images written since the last submission.
    unflushed: u64,
}

/// Images are submitted in pieces of about this size.
const FLUSH: u64 = 4 << 20;

/// The listener of long work.
pub(crate) type Listener<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

impl Session {
    /// Uploads the weights and allocates the backbone.
    ///
    /// # Errors
    /// When a weight is damaged, memory runs out, or `progress` broke off.
    pub fn new(engine: &Engine, weights: &Weights, plan: RunPlan, progress: Listener<'_>) -> Result<Self, OmnixError> {
        let keys: Vec<_> = plan.backbone.weights.iter().chain(&plan.head.weights).cloned().collect();
        let mut report = |done, total| progress(Progress { phase: Phase::Weights, done, total });
        let store = WeightStore::load(engine.gpu(), weights, &keys, &mut report)?;
        let backbone = Executable::new(engine.gpu(), plan.backbone.clone(), &store, &Bindings::default())?;
        Ok(Self { engine: engine.clone(), plan, store, backbone: Some(backbone), unflushed: 0 })
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &RunPlan {
        &self.plan
    }

    /// The backbone's memory is given back when it has run; a later run takes it again.
    fn backbone(&mut self) -> Result<&Executable, OmnixError> {
        if self.backbone.is_none() {
            let plan = self.plan.backbone.clone();
            self.backbone = Some(Executable::new(self.engine.gpu(), plan, &self.store, &Bindings::default())?);
        }
        self.backbone.as_ref().ok_or_else(|| OmnixError::Request { reason: "BUG: no backbone".to_owned() })
    }

    /// Writes image `index`: `[3, height, width]`, normalised (`omnix::io::preprocess::normalise`).
    ///
    /// # Errors
    /// When the index or the length is wrong.
    pub fn set_image(&mut self, index: usize, pixels: &[f32]) -> Result<(), OmnixError> {
        let size = 3 * self.plan.request.height * self.plan.request.width;
        if index >= self.plan.request.images || pixels.len() != size {
            let reason = format!(
                "image {index} with {} numbers; the plan has {} images of {size}",
                pixels.len(),
                self.plan.request.images
            );
            return Err(OmnixError::Request { reason });
        }
        self.backbone()?.write_at("images", index * size, pixels)?;
        // What is written waits in staging memory for the next submission: thousands of images must not pile up there.
        self.unflushed += size as u64 * 4;
        if self.unflushed >= FLUSH {
            self.unflushed = 0;
            self.engine.gpu().queue.submit([]);
            self.engine.gpu().wait()?;
        }
        Ok(())
    }

    /// Runs the network and hands each image's results to `each`, in order, as soon as they exist.
    ///
    /// # Errors
    /// When the device fails, `progress` broke off ([`OmnixError::Interrupted`]), or `each` did.
    pub fn run(
        &mut self,
        progress: Listener<'_>,
        each: &mut dyn FnMut(FrameGeometry) -> Result<(), OmnixError>,
    ) -> Result<(), OmnixError> {
        let gpu = self.engine.gpu().clone();
        self.run_resident(progress, &mut |frame| {
            let read = |slice: &BufferSlice| omnix_kernels::run::read::<f32>(&gpu, slice);
            let rays = frame.rays.as_ref().map(|(ray, conf)| Ok::<_, OmnixError>((read(ray)?, read(conf)?)));
            each(FrameGeometry {
                index: frame.index,
                depth: read(&frame.depth)?.into_iter().map(|d| d * frame.depth_scale).collect(),
                confidence: read(&frame.confidence)?,
                camera: frame.camera,
                rays: rays.transpose()?,
            })
        })
    }

    /// As [`Session::run`], with results that stay on the device: nothing is read back but the cameras, a few numbers. What
    /// the host submits to the engine's queue inside `each` sees this image's results; the next images overwrite them.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn run_resident(
        &mut self,
        progress: Listener<'_>,
        each: &mut dyn FnMut(ResidentGeometry) -> Result<(), OmnixError>,
    ) -> Result<(), OmnixError> {
        let (features, cameras, depth_scale) = self.run_backbone(progress)?;
        let (images, step) = (self.plan.request.images, self.plan.head_images);
        let head = Executable::new(self.engine.gpu(), self.plan.head.clone(), &self.store, &Bindings::default())?;
        let total = self.plan.head_flops();
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            self.fill_head(&head, &features, first, count)?;
            let before = head.plan().flops() * (first / step) as u64;
            head.run(&mut |done, _| progress(Progress { phase: Phase::Head, done: before + done, total }))?;
            let part = |name: &str, i: usize| {
                let all = head.slice(name)?;
                let size = all.size / step as u64;
                Ok::<_, OmnixError>(BufferSlice { offset: all.offset + i as u64 * size, size, buffer: all.buffer })
            };
            for i in 0..count {
                let rays = if self.plan.request.rays { Some((part("ray", i)?, part("ray_conf", i)?)) } else { None };
                each(ResidentGeometry {
                    index: first + i,
                    depth: part("depth", i)?,
                    confidence: part("depth_conf", i)?,
                    camera: cameras[first + i],
                    depth_scale,
                    rays,
                })?;
            }
        }
        Ok(())
    }

    /// Features on the device, cameras, and what depth is multiplied by to fit given cameras.
    fn run_backbone(&mut self, progress: Listener<'_>) -> Result<(Vec<BufferSlice>, Vec<Camera>, f32), OmnixError> {
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
        Ok((features, cameras, depth_scale))
    }

    /// Copies the features of images `first..first + count` into the head's inputs.
    fn fill_head(
        &self,
        head: &Executable,
        features: &[BufferSlice],
        first: usize,
        count: usize,
    ) -> Result<(), OmnixError> {
        let gpu = self.engine.gpu();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (k, feature) in features.iter().enumerate() {
            let input = head.slice(&format!("feat.{k}"))?;
            let image = feature.size / self.plan.request.images as u64;
            let from = feature.offset + first as u64 * image;
            encoder.copy_buffer_to_buffer(&feature.buffer, from, &input.buffer, input.offset, count as u64 * image);
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}
