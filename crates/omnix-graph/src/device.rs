//! A plan on a borrowed device: buffers, uploads, runs. All that touches a device is here.

pub mod exec;
#[cfg(not(target_arch = "wasm32"))]
pub mod profile;
pub mod run;
pub mod source;
pub mod store;
pub mod stream;
pub mod tensors;
mod upload;
