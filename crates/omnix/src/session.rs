//! A run on a device: images in, then results image by image, then the field that trajectories are evaluated from.

mod geometry;
mod handover;
mod joined;
mod masked;
mod motion;
mod on_device;
mod readback;
mod scaled;
#[cfg(not(target_arch = "wasm32"))]
mod warmup;

use omnix_graph::Bindings;
use omnix_kernels::BufferSlice;

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::event::{Event, Listener};
use crate::plan::RunPlan;
use crate::weights::Weights;
use on_device::{OnDevice, SessionWeights};
use readback::{Readbacks, Results};
#[cfg(not(target_arch = "wasm32"))]
use warmup::Warmup;

/// A planned run with its memory on the device.
#[derive(Debug)]
pub struct Session {
    engine: Engine,
    plan: RunPlan,
    weights: SessionWeights,
    backbone: Option<OnDevice>,
    /// The images, where more than one stage sees them.
    shared: Option<BufferSlice>,
    /// Which images were written since the backbone last ran.
    written: Vec<bool>,
    /// Ends when the session does.
    #[cfg(not(target_arch = "wasm32"))]
    _warmup: Warmup,
    /// Bytes of images written since the last submission.
    unflushed: u64,
}

/// Images are submitted in pieces of about this size.
const FLUSH: u64 = 4 << 20;

impl Session {
    /// Uploads the weights (or only verifies them, if the plan streams them) and allocates the backbone. Meanwhile, and
    /// while the first stages run, up to four threads make the pipelines of all stages (on lavapipe one of them submits an empty
    /// dispatch and waits for it).
    ///
    /// # Errors
    /// When a weight of any stage is damaged, memory runs out, or `listener` broke off.
    pub async fn new_async(
        engine: &Engine,
        weights: &Weights,
        plan: RunPlan,
        listener: Listener<'_>,
    ) -> Result<Self, OmnixError> {
        #[cfg(not(target_arch = "wasm32"))]
        let warmup = Warmup::start(engine.gpu(), &plan);
        let weights = SessionWeights::new(engine.gpu(), weights, &plan, listener).await?;
        let written = vec![false; plan.request.images];
        let mut session = Self {
            engine: engine.clone(),
            plan,
            weights,
            backbone: None,
            shared: None,
            written,
            #[cfg(not(target_arch = "wasm32"))]
            _warmup: warmup,
            unflushed: 0,
        };
        session.place_images().await?;
        Ok(session)
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &RunPlan {
        &self.plan
    }

    /// The backbone's memory is given back when it has run; a later run takes it again.
    async fn backbone(&mut self) -> Result<&OnDevice, OmnixError> {
        let made = match self.backbone.take() {
            Some(made) => made,
            None => self.weights.stage(&self.plan.backbone, &self.image_bindings(), &mut crate::quiet()).await?,
        };
        Ok(self.backbone.insert(made))
    }

    /// Makes room for the images: in the backbone, or in a buffer of their own where another stage sees them too.
    async fn place_images(&mut self) -> Result<BufferSlice, OmnixError> {
        if self.plan.shared_images() == 0 {
            return Ok(self.backbone().await?.slice("images")?);
        }
        let made = match self.shared.take() {
            Some(made) => made,
            None => {
                let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
                self.engine.gpu().buffer("images", self.plan.shared_images(), usage)?.into()
            }
        };
        Ok(self.shared.insert(made).clone())
    }

    /// The images as the input of a backbone, where they have a buffer of their own.
    fn image_bindings(&self) -> Bindings {
        self.shared.iter().map(|images| ("images".to_owned(), images.clone())).collect()
    }

    /// Writes image `index`: `[3, height, width]`, normalised (`omnix::io::preprocess::normalise`). A run uses the images up: all of
    /// them are written again before the next.
    ///
    /// # Errors
    /// When the index or the length is wrong, or a number is NaN or infinite: one would spoil every image.
    pub async fn set_image_async(&mut self, index: usize, pixels: &[f32]) -> Result<(), OmnixError> {
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
        let images = self.place_images().await?;
        let at = images.offset + (index * size * size_of::<f32>()) as u64;
        self.engine.gpu().queue.write_buffer(&images.buffer, at, bytemuck::cast_slice(pixels));
        self.written[index] = true;
        // What is written waits in staging memory for the next submission: thousands of images must not pile up there.
        self.unflushed += size as u64 * 4;
        if self.unflushed >= FLUSH {
            self.unflushed = 0;
            self.engine.gpu().queue.submit([]);
            self.engine.gpu().wait_async().await?;
        }
        Ok(())
    }

    /// Runs the network and tells `listener` each image's geometry, in order, while the device computes the next images; then, if
    /// the request asks for motion, what moves in each image, and the field. What was told is finished whatever happens
    /// later, and geometry that was computed when the listener breaks off is still told. Monocular, metric and nested networks tell
    /// nothing before all images are done, since the sky of each depends on all.
    ///
    /// # Errors
    /// When an image has not been set since the last run, the device fails, or `listener` failed or broke off.
    pub async fn run_async(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        let readbacks = Readbacks::new(self.engine.gpu(), self.plan.head_images);
        let (masks, grid) = (self.plan.request.masks.clone(), self.plan.request.grid());
        let mut scale = None;
        let scaled = self.plan.request.distance.is_some();
        let mut masked = |event| match event {
            Event::MetricScale(metres) if scaled => {
                scale = Some(metres);
                listener(event)
            }
            Event::Frame(mut frame) => {
                scale.into_iter().for_each(|scale| scaled::geometry(&mut frame, scale));
                masked::geometry(&mut frame, masks.as_deref(), grid);
                listener(Event::Frame(frame))
            }
            other => listener(other),
        };
        self.run_stages(&mut masked, Results::Readbacks(readbacks)).await
    }

    /// As [`Session::run_async`], with results that stay on the device ([`Event::Resident`]): nothing is read back but the cameras, a
    /// few numbers, and the maps of networks whose results depend on the sky of all images, which are put together on the host and
    /// written to the device again. What the host submits to the engine's queue while it is told of an image sees this image's results; the
    /// next images overwrite them.
    ///
    /// # Errors
    /// As [`Session::run_async`].
    pub async fn run_resident_async(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        if self.plan.request.said_masks().is_some() || self.plan.request.distance.is_some() {
            let reason =
                "masks and a known distance are for results on the host: run without `resident`, or leave them out";
            return Err(OmnixError::Request { reason: reason.to_owned() });
        }
        self.run_stages(listener, Results::Resident).await
    }

    async fn run_stages(&mut self, listener: Listener<'_>, mut results: Results) -> Result<(), OmnixError> {
        if let Some(image) = self.written.iter().position(|written| !written) {
            let reason =
                format!("image {image} has not been set: a run uses the images up, set all of them before each");
            return Err(OmnixError::Request { reason });
        }
        if self.plan.waits() {
            return self.run_joined(listener, &results).await;
        }
        let mut made = self.run_backbone(listener).await?;
        self.align(&mut made, listener)?;
        let mut motion = self.start_motion()?;
        let scale = self.run_head(&made, motion.as_mut(), listener, &mut results).await?;
        if let Some(motion) = motion {
            let mut field = self.run_motion(made, motion, listener).await?;
            if let Some(scale) = scale {
                field.rescale(scale).await?;
            }
            listener(Event::Field(Box::new(field)))?;
        }
        Ok(())
    }
}
