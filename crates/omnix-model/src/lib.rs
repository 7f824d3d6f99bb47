//! The networks as graphs: Depth Anything 3 (any view) and the encoder and geometry of OmniX.
//!
//! Source: `spec/da3.md` sections 1 to 8, 12, 17, 18 and `spec/omnix.md` sections 1, 3, 4. This crate *records* into an
//! [`omnix_graph::Graph`]; it computes nothing but tables that depend on sizes alone. Two graphs make a run: the backbone
//! over all views of a scene ([`Network::backbone`], cameras included), and the head over a chunk of frames
//! ([`Network::head`]), since frames do not see each other there.
//!
//! Layouts: tokens `[view · token, channel]`, token 0 of a view first, then patches row-major; maps `[frame, row, column,
//! channel]`. Values carry the names of the recorded references (`tok.block3`, `head.fuse2_aux`), so that a graph with
//! taps shows its inside. What the OmniX references call `backbone.block0` and `feat.k.camera` is `tok.block0` and
//! `feat.k.cam` here; their `out.pose_encoding` is `cam.pose_enc`.
//!
//! Not here yet, and refused by name: monocular and metric networks, nested ones, the Gaussian head (its tensors are known
//! and left out) and the trajectory module.

pub mod backbone;
mod camera;
pub mod config;
mod dpt;
mod error;
mod layers;
mod manifest;
mod network;

pub use backbone::{BackboneOutputs, BackboneSpec, Reference, ReferenceChoice};
pub use config::NetworkConfig;
pub use dpt::{HeadOutputs, HeadSpec};
pub use error::ModelError;
pub use manifest::{Parts, manifest};
pub use network::Network;

/// Side of a patch in pixels; picture sides are multiples of it.
pub const PATCH: usize = 14;
