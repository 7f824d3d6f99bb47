//! Results on their way to the host: copied as soon as an image is done, handed out while the device computes the next.

use std::collections::VecDeque;

use omnix_geometry::Camera;
use omnix_kernels::readback::Readback;
use omnix_kernels::{BufferSlice, Gpu};

use crate::error::OmnixError;
use crate::event::{Event, FrameGeometry, Listener, ResidentGeometry};

/// What takes the head's results.
pub(super) enum Results {
    /// They are told of where they are.
    Resident,
    /// They are read back.
    Readbacks(Readbacks),
}

impl Results {
    /// An image is done. What is submitted later overwrites its buffers.
    pub(super) async fn done(&mut self, image: ResidentGeometry, listener: Listener<'_>) -> Result<(), OmnixError> {
        match self {
            Self::Resident => listener(Event::Resident(image)),
            Self::Readbacks(readbacks) => readbacks.done(image, listener).await,
        }
    }

    /// The device has work: time for the host's.
    pub(super) async fn between(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        match self {
            Self::Resident => Ok(()),
            Self::Readbacks(readbacks) => readbacks.hand_out(listener).await,
        }
    }

    /// No image follows.
    pub(super) async fn finish(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        let Self::Readbacks(readbacks) = self else { return Ok(()) };
        while !readbacks.waiting.is_empty() {
            readbacks.hand_out(listener).await?;
        }
        Ok(())
    }
}

/// Reads results back. At most one chunk of images waits here; their staging memory is part of the plan.
pub(super) struct Readbacks {
    gpu: Gpu,
    /// Images of a chunk.
    most: usize,
    waiting: VecDeque<Copied>,
}

/// An image's results in staging memory.
struct Copied {
    index: usize,
    depth: Readback,
    confidence: Readback,
    camera: Camera,
    depth_scale: f32,
    rays: Option<(Readback, Readback)>,
}

impl Readbacks {
    pub(super) fn new(gpu: &Gpu, most: usize) -> Self {
        Self { gpu: gpu.clone(), most, waiting: VecDeque::with_capacity(most) }
    }

    async fn hand_out(&mut self, listener: Listener<'_>) -> Result<(), OmnixError> {
        let Some(image) = self.waiting.pop_front() else { return Ok(()) };
        let read = |copy: Readback| copy.finish_async::<f32>(&self.gpu);
        let rays = match image.rays {
            Some((ray, conf)) => Some((read(ray).await?, read(conf).await?)),
            None => None,
        };
        listener(Event::Frame(FrameGeometry {
            index: image.index,
            depth: read(image.depth).await?.into_iter().map(|d| d * image.depth_scale).collect(),
            confidence: read(image.confidence).await?,
            camera: image.camera,
            rays,
        }))
    }

    async fn done(&mut self, image: ResidentGeometry, listener: Listener<'_>) -> Result<(), OmnixError> {
        if self.waiting.len() == self.most {
            self.hand_out(listener).await?;
        }
        let copy = |slice: &BufferSlice| Readback::start(&self.gpu, slice);
        let rays = image.rays.as_ref().map(|(ray, conf)| Ok::<_, OmnixError>((copy(ray)?, copy(conf)?)));
        self.waiting.push_back(Copied {
            index: image.index,
            depth: copy(&image.depth)?,
            confidence: copy(&image.confidence)?,
            camera: image.camera,
            depth_scale: image.depth_scale,
            rays: rays.transpose()?,
        });
        Ok(())
    }
}
