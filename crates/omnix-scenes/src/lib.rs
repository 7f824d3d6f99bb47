//! Dynamic scenes made from a seed: pictures with exact depth, cameras and trajectories. No device.
//!
//! ```text
//! recipe, seed, index -> Stage (places, things, light) -> Scene -> Geometry at a time
//! camera, Geometry    -> hits (instance, triangle, barycentrics) -> depth, paths, masks, visibility   f64
//!                                                                -> light -> picture                  f32
//! ```
//! Metres and seconds; z is up. Everything is a pure function of recipe, assets, seed and index: the same bits on any number of
//! threads.

mod actor;
mod assets;
mod bvh;
mod cast;
mod clean;
mod error;
mod labels;
mod lens;
mod light;
mod material;
mod mesh;
mod model;
mod motion;
mod noise;
mod palette;
mod photo;
mod picture;
mod places;
mod random;
mod recipe;
mod rig;
mod sample;
mod scene;
mod shade;
mod shapes;
mod shots;
mod smear;
mod stage;
mod things;
#[cfg(test)]
mod truth;
mod validation;
mod view;
mod write;

pub use assets::Assets;
pub use clean::Refusal;
pub use error::ScenesError;
pub use model::{Flaw, Model};
pub use photo::Photo;
pub use random::Random;
pub use recipe::{Cameras, Inputs, Places, Recipe};
pub use sample::Samples;
pub use scene::Scene;
pub use shots::Input;
pub use validation::{VALIDATION_SAMPLES, validation};
pub use view::{PIXEL_CENTRE, View};
pub use write::{Done, Job, Labels, Layout};
