//! Results on their way to the host: copied as soon as an image is done, handed out while the device computes the next.

use std::collections::VecDeque;

use omnix_geometry::{Camera, GAUSSIAN_DEPTH_SHIFT, GAUSSIAN_NUMBERS};
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
    confidence: Option<Readback>,
    camera: Option<Camera>,
    depth_scale: f32,
    rays: Option<(Readback, Readback)>,
    gaussians: Option<Readback>,
    features: Vec<(usize, Readback)>,
}

/// The numbers of Gaussians where depth is scaled: so is the shift of each pixel's depth.
pub(super) fn scaled_gaussians(mut numbers: Vec<f32>, scale: f32) -> Vec<f32> {
    for pixel in numbers.chunks_exact_mut(GAUSSIAN_NUMBERS) {
        pixel[GAUSSIAN_DEPTH_SHIFT] *= scale;
    }
    numbers
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
        let gaussians = match image.gaussians {
            Some(numbers) => Some(read(numbers).await?),
            None => None,
        };
        let mut features = Vec::with_capacity(image.features.len());
        for (block, copy) in image.features {
            features.push((block, read(copy).await?));
        }
        listener(Event::Frame(FrameGeometry {
            index: image.index,
            depth: read(image.depth).await?.into_iter().map(|d| d * image.depth_scale).collect(),
            confidence: match image.confidence {
                Some(confidence) => Some(read(confidence).await?),
                None => None,
            },
            sky: None,
            camera: image.camera,
            rays,
            gaussians: gaussians.map(|numbers| scaled_gaussians(numbers, image.depth_scale)),
            features,
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
            confidence: image.confidence.as_ref().map(copy).transpose()?,
            camera: image.camera,
            depth_scale: image.depth_scale,
            rays: rays.transpose()?,
            gaussians: image.gaussians.as_ref().map(copy).transpose()?,
            features: image
                .features
                .iter()
                .map(|(block, all)| Ok((*block, copy(all)?)))
                .collect::<Result<_, OmnixError>>()?,
        });
        Ok(())
    }
}
