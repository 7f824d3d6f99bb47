//! What to reconstruct.

use std::path::PathBuf;

use omnix_geometry::{AlignTo, Camera};
use omnix_kernels::WeightType;
use omnix_model::backbone::ReferenceChoice;

use crate::error::OmnixError;

/// Images of one scene, all of one size, and what is wanted of them.
#[derive(Clone, Debug)]
pub struct Request {
    /// Number of images.
    pub images: usize,
    /// Rows of an image; a multiple of 14.
    pub height: usize,
    /// Columns of an image; a multiple of 14.
    pub width: usize,
    /// (video, frame in its video) of each image, for networks with time codes; by default one video in order.
    pub times: Vec<(u32, u32)>,
    /// Which view carries the reference token; `None` is the network's own default.
    pub reference: Option<ReferenceChoice>,
    /// Known cameras (for the processed size), world-to-camera.
    pub cameras: Option<Vec<Camera>>,
    /// What known cameras do to the result.
    pub align: AlignTo,
    /// Whether ray maps are wanted; they cost about as much as depth.
    pub rays: bool,
    /// Whether trajectories are wanted; they need a network that has them.
    pub motion: bool,
    /// How weights are stored on the device.
    pub storage: WeightType,
    /// Whether weights stay on the device for the next run. If not, those of a stage that runs once pass through while it runs, and
    /// those of one that runs a few images at a time leave when it is done: less memory, and a further run uploads them again.
    pub keep_weights: bool,
    /// Bytes of device memory that the run may take.
    pub budget: Option<u64>,
    /// Chains go in at least so many parts; 1 unless a test wants chunks.
    pub parts: usize,
    /// Images through the head at a time; `None` lets the device's kind and the budget decide.
    pub head_images: Option<usize>,
    /// Images through the sampling head at a time, alike.
    pub sampling_images: Option<usize>,
    /// Where a field is kept; by default on the device if the budget allows it.
    pub field: FieldPlace,
}

/// Where a field is kept while it is used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FieldPlace {
    /// On the device if it fits the budget, else as [`FieldPlace::Spool`] in the system's folder for temporary files.
    #[default]
    Auto,
    /// As [`FieldPlace::Auto`], with the spool file in this folder.
    AutoIn(PathBuf),
    /// On the device.
    Device,
    /// In an unnamed file in this folder, from which one image at a time goes to the device.
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
            times: (0..images as u32).map(|i| (0, i)).collect(),
            reference: None,
            cameras: None,
            align: AlignTo::Given,
            rays: false,
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
        if self.times.len() != self.images {
            return wrong(format!("{} times for {} images", self.times.len(), self.images));
        }
        if let Some(cameras) = &self.cameras
            && cameras.len() != self.images
        {
            return wrong(format!("{} cameras for {} images", cameras.len(), self.images));
        }
        Ok(())
    }
}

/// Pixels along a patch.
pub(crate) const PATCH: usize = 14;
