//! The compact form of all motion: what trajectories are evaluated from.
//!
//! For every source image a field (nine numbers for each level, target time and cell), a mask of cells, and for every pixel
//! where it samples them (offsets, weights) and its world point. Trajectories of chosen pixels and times come from it at
//! any time ([`Field::paths`], [`Field::stream`], [`Field::resident_paths`]); all of them at once would be T² · H · W points.
//! It lives on the device, or in a file from which one image at a time goes to the device, and can be saved and opened again
//! ([`Field::save`], whose module documents the file).

#[cfg(feature = "io")]
mod choice;
mod chunk;
mod evaluate;
#[cfg(feature = "io")]
mod file;
mod maps;
#[cfg(feature = "io")]
mod pictures;
mod query;
#[cfg(feature = "io")]
mod saved;
mod shape;
mod store;
mod values;

use omnix_geometry::Camera;
use omnix_graph::ops::{Gate, Motion};
use omnix_kernels::Gpu;

#[cfg(feature = "io")]
pub use choice::ImageMotion;
pub use chunk::Chunk;
pub(crate) use chunk::{fit, least};
pub(crate) use maps::{ImageMaps, Maps};
pub use query::{PathPiece, Paths, Pixels, Query, ResidentPaths};
#[cfg(feature = "io")]
pub use saved::FieldPrecision;
#[cfg(feature = "io")]
pub(crate) use saved::WINDOW;
pub use shape::FieldShape;
pub(crate) use shape::Part;
pub(crate) use store::{Store, copy};
pub use values::PixelValues;

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::weights::Weights;

/// What trajectories are evaluated from.
#[derive(Debug)]
pub struct Field {
    engine: Engine,
    shape: FieldShape,
    motion: Motion,
    store: Store,
    /// Bytes of the device that an evaluation may take.
    room: Option<u64>,
    images: Vec<FieldImage>,
    maps: Maps,
    about: About,
}

/// What is known of one image beside its part of the field; of its pixels, [`Field::pixel_values`] tells more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldImage {
    /// Index of its video.
    pub video: u32,
    /// Frame in its video.
    pub frame: u32,
    /// Seconds from the start of its video, where known.
    pub time_s: Option<f64>,
    /// World-to-camera pose and intrinsics in pixels of the processed image.
    pub camera: Camera,
}

/// Where a field comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Name of the network.
    pub network: String,
    /// Its weights, and their digest where that was asked for.
    pub weights: String,
    /// Name of the unit of length.
    pub unit: String,
    /// A caution that belongs with every result.
    pub note: Option<String>,
    /// Digest of the window of a film that it is the field of.
    pub window: Option<String>,
}

/// How the network's points move.
pub(crate) fn motion_of(weights: &Weights) -> Result<Motion, OmnixError> {
    let config = weights.network().config();
    let trajectory = config.trajectory.as_ref().ok_or_else(|| OmnixError::NoMotion { network: config.name.clone() })?;
    Ok(trajectory.motion())
}

impl Field {
    /// A field without scores.
    pub(crate) fn new(
        engine: &Engine,
        (shape, motion): (FieldShape, Motion),
        store: Store,
        room: Option<u64>,
        (images, maps): (Vec<FieldImage>, Maps),
        about: About,
    ) -> Self {
        Self { engine: engine.clone(), shape, motion, store, room, images, maps, about }
    }

    /// Its sizes.
    #[must_use]
    pub fn shape(&self) -> &FieldShape {
        &self.shape
    }

    /// How points move.
    #[must_use]
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// What is known of each image, in the order of target times.
    #[must_use]
    pub fn images(&self) -> &[FieldImage] {
        &self.images
    }

    /// Adds seconds and changes cameras, which the engine knows in part.
    pub fn images_mut(&mut self) -> &mut [FieldImage] {
        &mut self.images
    }

    /// Where it comes from.
    #[must_use]
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Changes what is said of where it comes from.
    pub fn about_mut(&mut self) -> &mut About {
        &mut self.about
    }

    /// Whether it is kept on the device; else one image at a time goes there.
    #[must_use]
    pub fn on_device(&self) -> bool {
        self.store.on_device()
    }

    /// Bounds the device memory that an evaluation may take.
    pub fn set_room(&mut self, bytes: Option<u64>) {
        self.room = bytes;
    }

    /// Whether the gate lets a pixel with this score move.
    #[must_use]
    pub fn moves(&self, theta: f32) -> bool {
        match self.motion.gate {
            Gate::None => true,
            Gate::Hard(threshold) => theta > threshold,
            Gate::Blend => theta > 0.0,
        }
    }

    /// Measures all lengths in a unit that is this many times smaller: points, how they move, and cameras.
    pub(crate) async fn rescale(&mut self, scale: f64) -> Result<(), OmnixError> {
        let times = scale as f32;
        for image in 0..self.shape.images {
            let mut points = self.store.numbers(image, Part::Points).await?;
            points.iter_mut().for_each(|length| *length *= times);
            self.store.replace(image, Part::Points, &points)?;
            // Six numbers of rotation, three of translation.
            let mut field = self.store.numbers(image, Part::Field).await?;
            field.chunks_exact_mut(9).for_each(|cell| cell[6..].iter_mut().for_each(|length| *length *= times));
            self.store.replace(image, Part::Field, &field)?;
        }
        for row in self.images.iter_mut().flat_map(|image| &mut image.camera.extrinsics) {
            row[3] = (f64::from(row[3]) * scale) as f32;
        }
        Ok(())
    }

    /// World points of an image's pixels at its own time, `[height, width, 3]`.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image that is not there; failures of the device or of reading a file.
    pub async fn points_async(&self, image: usize) -> Result<Vec<f32>, OmnixError> {
        self.check_image(image)?;
        self.store.numbers(image, Part::Points).await
    }

    /// Bytes read so far from the file of a saved field; 0 for any other.
    #[must_use]
    pub fn bytes_read(&self) -> u64 {
        self.store.bytes_read()
    }

    fn room(&self) -> Option<u64> {
        self.room
    }

    fn gpu(&self) -> &Gpu {
        self.engine.gpu()
    }
}
