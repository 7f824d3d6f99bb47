//! Imported models: read from files, checked, and brought into the axes, units and meshes of scenes.

mod catalogue;
mod flaw;
mod gltf;
mod obj;
mod puppet;
mod raw;
mod read;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::samples;
mod texture;

pub(crate) use catalogue::{CATALOGUE, Entry, entries};
pub use flaw::Flaw;
pub use read::Model;
pub(crate) use read::Stand;
