//! The part of this crate that touches a device: finding and opening one, its facts, buffers and pipelines, and running dispatches.
//! Everything outside of this folder, except measuring (`bench`), is pure.

pub mod adapter;
#[cfg(not(target_arch = "wasm32"))]
pub mod compile;
pub mod gpu;
pub mod host_memory;
pub mod program;
pub mod readback;
#[cfg(not(target_arch = "wasm32"))]
pub mod run;

mod facts;
mod lost;
#[cfg(not(target_arch = "wasm32"))]
mod software;
mod wait;

#[cfg(not(target_arch = "wasm32"))]
pub use software::why_software;
