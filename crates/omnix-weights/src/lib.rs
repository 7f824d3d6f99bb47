//! Checkpoints: files of tensors (`omnix-tensors`), their `config.json`, tensor names, the pass that verifies them, and conversion.
//!
//! Source of the file layouts: `spec/da3.md` section 12 and `spec/omnix.md` section 1. A [`Checkpoint`] is a folder
//! with `config.json` and `model.safetensors` (or shards and `model.safetensors.index.json`), a checkpoint of PyTorch, or bytes inside
//! the program. Opening reads the header alone; tensors are read when they are asked for, so a checkpoint of several
//! gigabytes costs no memory before it is uploaded.
//!
//! Names below are *logical*: without the prefix (`model.`, `net.`, none, or that of a wrapper such as `module.`) under which
//! a file stores them. Layouts are those of the file: row-major, the last dimension contiguous, little endian.
//!
//! What a network expects is a [`Manifest`], made by `omnix-model`; [`check`] compares the two and names every
//! difference. This crate knows no network beyond the guess of [`describe`] and the configurations of published ones (`known.rs`), no
//! graph and no device.

mod checkpoint;
mod config;
mod convert;
mod describe;
mod error;
mod hub;
mod known;
mod locate;
mod manifest;
pub mod names;
mod open;
mod published;
mod report;
mod verify;

pub use checkpoint::Checkpoint;
pub use convert::{Conversion, Converted};
pub use describe::describe;
pub use error::WeightsError;
pub use manifest::{Expected, Manifest, Requirement, check};
pub use names::{METRIC, Scope};
pub use omnix_tensors::{Findings, Float, TensorError, TensorFile, TensorInfo, TensorView};
pub use published::{PUBLISHED, Published, licence};
pub use report::{CheckReport, WrongShape};
pub use verify::Verified;
