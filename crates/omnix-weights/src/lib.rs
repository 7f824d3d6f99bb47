//! Checkpoints: safetensors files (`omnix-tensors`), their `config.json`, tensor names, and the pass that verifies them.
//!
//! Source of the file layouts: `spec/da3.md` section 12 and `spec/omnix.md` section 1. A [`Checkpoint`] is a folder
//! with `config.json` and `model.safetensors` (or shards and `model.safetensors.index.json`), or bytes inside the
//! program. Opening reads the header alone; tensors are read when they are asked for, so a checkpoint of several
//! gigabytes costs no memory before it is uploaded.
//!
//! Names below are *logical*: without the prefix (`model.`, `net.`, none, or that of a wrapper such as `module.`) under which
//! a file stores them. Layouts are those of the file: row-major, the last dimension contiguous, little endian.
//!
//! What a network expects is a [`Manifest`], made by `omnix-model`; [`check`] compares the two and names every
//! difference. This crate knows no network beyond the guess of [`describe`], no graph and no device. PyTorch pickles
//! are recognised and refused.

mod checkpoint;
mod config;
mod describe;
mod error;
mod locate;
mod manifest;
pub mod names;
mod report;
mod verify;

pub use checkpoint::Checkpoint;
pub use describe::describe;
pub use error::WeightsError;
pub use manifest::{Expected, Manifest, Requirement, check};
pub use names::Scope;
pub use omnix_tensors::{Findings, TensorError, TensorFile, TensorInfo, TensorView};
pub use report::{CheckReport, WrongShape};
pub use verify::Verified;
