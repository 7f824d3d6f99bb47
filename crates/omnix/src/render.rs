//! Pictures of a reconstructed scene without a window: its points as discs that close holes, with trails of what moves and the
//! frusta of cameras, from any camera and at any time.
//!
//! [`Renderer`] draws points with the kernel `splat` on the host's device. The rest is bookkeeping on the processor: a [`Source`] is
//! where images and paths of points come from ([`crate::Field`] is one), a [`Stage`] holds the points worth drawing and where they are
//! at a time, [`Marks`] are trails and frusta as [`Line`]s, which become rows of small discs ([`dots`]), so that they are hidden and
//! smoothed as everything else is. Something else than discs, such as Gaussians, would be another kernel behind a renderer of its own;
//! sources, stages, marks and cameras stay.
//!
//! ```no_run
//! use omnix::render::{RenderPlan, Renderer, Shot, Stage, StageOptions};
//! use omnix::{Engine, Field};
//!
//! # fn main() -> Result<(), omnix::OmnixError> {
//! let engine = Engine::open(None)?; // or Engine::new(&device, &queue)
//! let field = Field::open(&engine, "out/field.safetensors".as_ref())?;
//! let mut stage = Stage::read(&field, &StageOptions::default(), &mut |_| Ok(()))?;
//! let size = stage.size().map(|side| side as u32);
//! let renderer = Renderer::new(&engine, RenderPlan::new(stage.count()[1], size, engine.caps())?)?;
//! let mut first = 0;
//! for (sizes, colours) in stage.looks() {
//!     renderer.write_looks(first, sizes, colours)?;
//!     first += sizes.len();
//! }
//! // Between the first and the second image, from the first camera.
//! let moving = stage.moving_at(&field, 0.5)?;
//! renderer.write_positions(0, &moving)?;
//! renderer.write_positions(moving.len(), stage.still())?;
//! let near = 0.02 * stage.distance();
//! let shot = Shot { camera: stage.cameras()[0], near, layer: 0.015, background: [1.0; 4] };
//! let picture = renderer.picture(&shot)?; // or resident_picture_async, which stays on the device
//! # let _ = picture;
//! # Ok(())
//! # }
//! ```

#[cfg(not(target_arch = "wasm32"))]
mod field;
#[cfg(feature = "io")]
mod film;
mod lines;
mod marks;
mod renderer;
mod stage;
mod surface;

use omnix_geometry::Camera;

pub use lines::{Dots, Line, dots};
pub use marks::Marks;
pub use renderer::{RenderPlan, Rendered, Renderer, Shot};
pub use stage::{Shown, Stage, StageOptions};

use crate::error::OmnixError;

/// Images of a scene with a world point for every pixel, and where these points are when the other images are taken.
pub trait Source {
    /// Width and height of every image.
    fn size(&self) -> [usize; 2];

    /// Every image's camera, in the order of times; the pixel of column x has its centre at x + 0.5.
    fn cameras(&self) -> Vec<Camera>;

    /// What the pixels of an image are, at its own time.
    ///
    /// # Errors
    /// Failures of the device or of reading a file.
    fn image(&self, image: usize) -> Result<ImagePoints, OmnixError>;

    /// Where the points of some pixels (row · width + column) of an image are at a time; NaN where that is not known.
    ///
    /// # Errors
    /// As [`Source::image`].
    fn positions(&self, image: usize, pixels: &[u32], time: usize) -> Result<Vec<[f32; 3]>, OmnixError>;
}

/// An image's pixels, each list row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImagePoints {
    /// World positions; not finite where there is no point.
    pub positions: Vec<[f32; 3]>,
    /// Red, green, blue.
    pub colours: Vec<[u8; 3]>,
    /// Confidence, where it is known.
    pub confidence: Option<Vec<f32>>,
    /// Which of them may be elsewhere at other times.
    pub moving: Vec<bool>,
}
