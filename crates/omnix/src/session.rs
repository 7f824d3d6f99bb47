//! A run on a device: images in, then results image by image, then the field that trajectories are evaluated from.

mod motion;
mod on_device;
mod readback;
mod stages;
mod warmup;

use std::ops::ControlFlow;

use omnix_geometry::Camera;
use omnix_graph::Bindings;
use omnix_kernels::BufferSlice;

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::field::Field;
use crate::plan::RunPlan;
use crate::progress::Progress;
use crate::weights::Weights;
use on_device::{OnDevice, SessionWeights};
use readback::{HandOut, Resident, Results};
use warmup::Warmup;

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
    /// World points `[height, width, 3]`, where trajectories are wanted.
    pub points: Option<BufferSlice>,
}

/// A planned run with its memory on the device.
#[derive(Debug)]
pub struct Session {
    engine: Engine,
    plan: RunPlan,
    weights: SessionWeights,
    backbone: Option<OnDevice>,
    /// Ends when the session does.
    _warmup: Warmup,
    /// Bytes of images written since the last submission.
    unflushed: u64,
}

/// Images are submitted in pieces of about this size.
const FLUSH: u64 = 4 << 20;

/// The listener of long work.
pub(crate) type Listener<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

impl Session {
    /// Uploads the weights (or only verifies them, if the plan streams them) and allocates the backbone. Meanwhile, and
    /// while the first stages run, up to four threads make the pipelines of all stages (on lavapipe one of them submits a dispatch of
    /// nothing and waits for it).
    ///
    /// # Errors
    /// When a weight of any stage is damaged, memory runs out, or `progress` broke off.
    pub fn new(engine: &Engine, weights: &Weights, plan: RunPlan, progress: Listener<'_>) -> Result<Self, OmnixError> {
        let warmup = Warmup::start(engine.gpu(), &plan);
        let weights = SessionWeights::new(engine.gpu(), weights, &plan, progress)?;
        let mut session = Self { engine: engine.clone(), plan, weights, backbone: None, _warmup: warmup, unflushed: 0 };
        session.backbone()?;
        Ok(session)
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &RunPlan {
        &self.plan
    }

    /// The backbone's memory is given back when it has run; a later run takes it again.
    fn backbone(&mut self) -> Result<&OnDevice, OmnixError> {
        let made = match self.backbone.take() {
            Some(made) => made,
            None => self.weights.stage(&self.plan.backbone, &Bindings::default(), &mut crate::quiet())?,
        };
        Ok(self.backbone.insert(made))
    }

    /// Writes image `index`: `[3, height, width]`, normalised (`omnix::io::preprocess::normalise`).
    ///
    /// # Errors
    /// When the index or the length is wrong, or a number is not finite: one would spoil every image.
    pub fn set_image(&mut self, index: usize, pixels: &[f32]) -> Result<(), OmnixError> {
        let (width, plane) = (self.plan.request.width, self.plan.request.height * self.plan.request.width);
        let size = 3 * plane;
        if index >= self.plan.request.images || pixels.len() != size {
            let reason = format!(
                "image {index} with {} numbers; the plan has {} images of {size}",
                pixels.len(),
                self.plan.request.images
            );
            return Err(OmnixError::Request { reason });
        }
        if let Some(at) = pixels.iter().position(|v| !v.is_finite()) {
            let (value, x, y) = (pixels[at], at % plane % width, at % plane / width);
            return Err(OmnixError::Request {
                reason: format!(
                    "image {index} has {value} at pixel {x},{y}: give finite numbers, or leave the image out"
                ),
            });
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

    /// Runs the network and hands each image's results to `each`, in order, while the device computes the next images; then
    /// makes the field, if the request asks for motion. What `each` was given is finished whatever happens later, and what
    /// was computed when `progress` breaks off is still given.
    ///
    /// # Errors
    /// When the device fails, `progress` broke off ([`OmnixError::Interrupted`]), or `each` did.
    pub fn run(
        &mut self,
        progress: Listener<'_>,
        each: &mut dyn FnMut(FrameGeometry) -> Result<(), OmnixError>,
    ) -> Result<Option<Field>, OmnixError> {
        let gpu = self.engine.gpu().clone();
        let mut results = HandOut::new(&gpu, self.plan.head_images, each);
        self.run_stages(progress, &mut results)
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
    ) -> Result<Option<Field>, OmnixError> {
        self.run_stages(progress, &mut Resident(each))
    }

    fn run_stages(&mut self, progress: Listener<'_>, results: &mut dyn Results) -> Result<Option<Field>, OmnixError> {
        let kept = self.run_backbone(progress)?;
        let mut motion = self.start_motion()?;
        self.run_head(&kept, motion.as_mut(), progress, results)?;
        match motion {
            Some(motion) => self.run_motion(kept, motion, progress).map(Some),
            None => Ok(None),
        }
    }
}
