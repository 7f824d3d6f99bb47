//! What to reconstruct.

#[cfg(feature = "io")]
use std::path::PathBuf;
use std::sync::Arc;

use omnix_geometry::{AlignTo, Camera, fit_cameras};
use omnix_kernels::WeightType;
use omnix_model::backbone::ReferenceChoice;
use omnix_model::config::{DepthUnit, NetworkConfig};

use crate::error::OmnixError;
use crate::masks::Masks;

/// Images of one scene, all of one size, and what is wanted of them. Made by [`Request::new`] and changed by the methods of its
/// fields' names.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Request {
    /// Number of images.
    pub images: usize,
    /// Rows of an image; a multiple of 14.
    pub height: usize,
    /// Columns of an image; a multiple of 14.
    pub width: usize,
    /// (video, frame in its video) of each image, for networks with time codes; `None` is one video in order.
    pub times: Option<Vec<(u32, u32)>>,
    /// Which view carries the reference token; `None` is the network's own default.
    pub reference: Option<ReferenceChoice>,
    /// Known cameras (for the processed size), world-to-camera. For any-view networks with a camera encoder, and for metric networks:
    /// these become the cameras of the results, and their focal lengths turn depth into metres.
    pub cameras: Option<Vec<Camera>>,
    /// What known cameras do to the result.
    pub align: AlignTo,
    /// What is said of pixels beforehand: which to ignore, which stand still, which move.
    pub masks: Option<Arc<Masks>>,
    /// A distance that is known in metres, to which all results are brought; for networks that make cameras and do not know the metre.
    pub distance: Option<KnownDistance>,
    /// Whether ray maps are wanted; they cost about as much as depth.
    pub rays: bool,
    /// Blocks of the encoder, from 0, whose features are wanted.
    pub features: Vec<usize>,
    /// Whether Gaussians are wanted; they need a network with a head for them.
    pub gaussians: bool,
    /// Whether trajectories are wanted; they need a network that has them.
    pub motion: bool,
    /// How weights are stored on the device.
    pub storage: WeightType,
    /// Whether weights stay on the device for the next run. If not, those of a stage that runs once pass through while it runs, and
    /// those of one that runs a few images at a time leave when it is done: less memory, and a further run uploads them again.
    pub keep_weights: bool,
    /// Bytes of device memory that the run may take.
    pub budget: Option<u64>,
    /// Minimum number of row chunks per chain. Leave at 1; tests raise it.
    pub parts: usize,
    /// Images through the head at a time; `None` lets the device's kind and the budget decide.
    pub head_images: Option<usize>,
    /// The same for the sampling head.
    pub sampling_images: Option<usize>,
    /// Where a field is kept; by default on the device if the budget allows it.
    pub field: FieldPlace,
}

/// A distance between two places that one image shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownDistance {
    /// The image.
    pub image: usize,
    /// Column and row of each place in the processed image, whole numbers at the middles of pixels.
    pub places: [[f32; 2]; 2],
    /// Metres between them.
    pub metres: f64,
}

/// Where a field is kept while it is used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum FieldPlace {
    /// On the device if it fits the budget, else (feature `io`) as `FieldPlace::Spool` in the system's folder for temporary files.
    #[default]
    Auto,
    /// As `Auto`, with the spool file in this folder.
    #[cfg(feature = "io")]
    AutoIn(PathBuf),
    /// On the device.
    Device,
    /// In an unnamed file in this folder, from which one image at a time goes to the device.
    #[cfg(feature = "io")]
    Spool(PathBuf),
}

impl Request {
    /// `images` images of `height` × `width` with every default.
    #[must_use]
    pub fn new(images: usize, height: usize, width: usize) -> Self {
        Self {
            images,
            height,
            width,
            times: None,
            reference: None,
            cameras: None,
            align: AlignTo::Given,
            masks: None,
            distance: None,
            rays: false,
            features: Vec::new(),
            gaussians: false,
            motion: false,
            storage: WeightType::F32,
            keep_weights: true,
            budget: None,
            parts: 1,
            head_images: None,
            sampling_images: None,
            field: FieldPlace::Auto,
        }
    }

    /// Patch rows and columns.
    #[must_use]
    pub fn grid(&self) -> (usize, usize) {
        (self.height / PATCH, self.width / PATCH)
    }

    /// (video, frame in its video) of each image.
    pub(crate) fn image_times(&self) -> Vec<(u32, u32)> {
        self.times.clone().unwrap_or_else(|| (0..self.images as u32).map(|image| (0, image)).collect())
    }

    /// Checks counts and sizes.
    ///
    /// # Errors
    /// [`OmnixError::Request`].
    pub(crate) fn check(&self) -> Result<(), OmnixError> {
        let wrong = |reason: String| Err(OmnixError::Request { reason });
        if self.images == 0 {
            return wrong("there are no images".to_owned());
        }
        if self.height < PATCH
            || self.width < PATCH
            || !self.height.is_multiple_of(PATCH)
            || !self.width.is_multiple_of(PATCH)
        {
            let (h, w) = (self.height, self.width);
            return wrong(format!(
                "images of {w}x{h} pixels: both sides must be multiples of {PATCH}; use the preprocessing of omnix::io"
            ));
        }
        if u32::try_from(self.images).is_err() {
            return wrong(format!("{} images: frames are counted in 32 bits", self.images));
        }
        if let Some(times) = &self.times
            && times.len() != self.images
        {
            return wrong(format!("{} times for {} images", times.len(), self.images));
        }
        if let Some(cameras) = &self.cameras
            && cameras.len() != self.images
        {
            return wrong(format!("{} cameras for {} images", cameras.len(), self.images));
        }
        self.masks.as_ref().map_or(Ok(()), |masks| masks.check(self.images, self.height * self.width))
    }

    /// Masks that say anything.
    pub(crate) fn said_masks(&self) -> Option<&Masks> {
        self.masks.as_deref().filter(|masks| masks.any())
    }

    /// Whether known cameras go into the network; a metric network alone takes no more of them than their lenses, for the metre.
    pub(crate) fn feeds_cameras(&self, config: &NetworkConfig) -> bool {
        self.cameras.is_some() && config.makes_cameras()
    }

    /// Checks a known distance.
    ///
    /// # Errors
    /// [`OmnixError::Request`].
    pub(crate) fn check_distance(&self, config: &NetworkConfig) -> Result<(), OmnixError> {
        let Some(KnownDistance { image, places, metres }) = self.distance else { return Ok(()) };
        let wrong = |reason: String| Err(OmnixError::Request { reason });
        if self.cameras.is_some() {
            return wrong("known cameras have a unit of length already: give them or a known distance".to_owned());
        }
        if config.unit != DepthUnit::Own {
            return wrong(format!("{} measures in metres already: leave the known distance out", config.name));
        }
        if !config.makes_cameras() {
            return wrong(format!("{} makes no cameras, without which no distance can be measured", config.name));
        }
        let (width, height) = (self.width as f32, self.height as f32);
        let inside = |[x, y]: [f32; 2]| (-0.5..width - 0.5).contains(&x) && (-0.5..height - 0.5).contains(&y);
        if image >= self.images || !places.into_iter().all(inside) {
            return wrong(format!(
                "the known distance is between places of image {image} at {places:?}; there are {} images of {width}x{height}",
                self.images
            ));
        }
        if !(metres.is_finite() && metres > 0.0) {
            return wrong(format!("a known distance of {metres} metres: give one above 0"));
        }
        Ok(())
    }

    /// Checks known cameras that go into the network: what brings them and its own together needs three centres that are not on a line.
    ///
    /// # Errors
    /// [`OmnixError::Request`].
    pub(crate) fn check_given_cameras(&self) -> Result<(), OmnixError> {
        let poses: Vec<_> = self.cameras.iter().flatten().map(|camera| camera.extrinsics).collect();
        fit_cameras(&poses, &poses).map(|_| ()).map_err(|error| OmnixError::Request {
            reason: format!("known cameras that cannot be brought together with the network's own ({error})"),
        })
    }
}

/// One method for each field that has a default.
impl Request {
    /// Number of images.
    #[must_use]
    pub fn images(mut self, images: usize) -> Self {
        self.images = images;
        self
    }

    /// (video, frame) of each image.
    #[must_use]
    pub fn times(mut self, times: Vec<(u32, u32)>) -> Self {
        self.times = Some(times);
        self
    }

    /// Which view carries the reference token; `None` is the network's own default.
    #[must_use]
    pub fn reference(mut self, reference: impl Into<Option<ReferenceChoice>>) -> Self {
        self.reference = reference.into();
        self
    }

    /// Whether ray maps are wanted.
    #[must_use]
    pub fn rays(mut self, rays: bool) -> Self {
        self.rays = rays;
        self
    }

    /// Blocks of the encoder, from 0, whose features are wanted; each once.
    #[must_use]
    pub fn features(mut self, mut features: Vec<usize>) -> Self {
        features.sort_unstable();
        features.dedup();
        self.features = features;
        self
    }

    /// Whether Gaussians are wanted.
    #[must_use]
    pub fn gaussians(mut self, gaussians: bool) -> Self {
        self.gaussians = gaussians;
        self
    }

    /// Whether trajectories are wanted.
    #[must_use]
    pub fn motion(mut self, motion: bool) -> Self {
        self.motion = motion;
        self
    }

    /// How weights are stored on the device.
    #[must_use]
    pub fn storage(mut self, storage: WeightType) -> Self {
        self.storage = storage;
        self
    }

    /// Whether weights stay on the device for the next run.
    #[must_use]
    pub fn keep_weights(mut self, keep_weights: bool) -> Self {
        self.keep_weights = keep_weights;
        self
    }

    /// Bytes of device memory that the run may take; `None` for no bound.
    #[must_use]
    pub fn budget(mut self, budget: impl Into<Option<u64>>) -> Self {
        self.budget = budget.into();
        self
    }

    /// Minimum number of row chunks per chain.
    #[must_use]
    pub fn parts(mut self, parts: usize) -> Self {
        self.parts = parts;
        self
    }

    /// Images through the head at a time; `None` lets the device's kind and the budget decide.
    #[must_use]
    pub fn head_images(mut self, head_images: impl Into<Option<usize>>) -> Self {
        self.head_images = head_images.into();
        self
    }

    /// Images through the sampling head at a time; `None` lets the device's kind and the budget decide.
    #[must_use]
    pub fn sampling_images(mut self, sampling_images: impl Into<Option<usize>>) -> Self {
        self.sampling_images = sampling_images.into();
        self
    }

    /// Where a field is kept.
    #[must_use]
    pub fn field(mut self, field: FieldPlace) -> Self {
        self.field = field;
        self
    }

    /// A distance that is known in metres; for results on the host.
    #[must_use]
    pub fn distance(mut self, distance: KnownDistance) -> Self {
        self.distance = Some(distance);
        self
    }

    /// What is said of pixels beforehand; for results on the host.
    #[must_use]
    pub fn masks(mut self, masks: Masks) -> Self {
        self.masks = Some(Arc::new(masks));
        self
    }

    /// Known cameras (for the processed size), world-to-camera, and what they do to the result.
    #[must_use]
    pub fn cameras(mut self, cameras: Vec<Camera>, align: AlignTo) -> Self {
        (self.cameras, self.align) = (Some(cameras), align);
        self
    }
}

/// Pixels along a patch.
pub(crate) const PATCH: usize = 14;
