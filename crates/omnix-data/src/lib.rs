//! Ground truth for training and evaluation: one type of sample, whatever it was read or made from. No device and no network here.
//!
//! [`Sample`] holds the images of a moving scene with what is known about them; its file says every convention. [`sets`] opens data sets
//! on disk, and [`read()`] makes a sample of chosen images of a scene. [`draw()`] chooses images and [`augment`] changes colours, as functions of a seed; [`normalise()`]
//! and [`targets`] make of a sample what training wants. [`check`] measures whether a data set agrees with itself, [`sheet()`] shows it.

pub mod augment;
pub mod check;
mod dense;
mod draw;
mod error;
mod files;
mod fit;
mod join;
#[cfg(test)]
mod made;
mod normalise;
mod posed;
mod random;
mod read;
mod rigid;
mod sample;
mod scene;
mod set;
pub mod sets;
mod sheet;
pub mod targets;

pub use dense::rasterise;
pub use draw::{Rule, draw};
pub use error::DataError;
pub use join::join;
pub use normalise::{Normalised, mean_distance, normalise};
pub use read::{ReadOptions, read};
pub use sample::{Dense, Flag, Motion, PIXEL, Sample, SampleParts, Time, Tracks, Unit};
pub use scene::{Pick, Scene, Video, View};
pub use set::Set;
pub use sheet::{Overview, sheet};
