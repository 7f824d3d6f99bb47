//! The networks as graphs: Depth Anything 3 (any view, monocular, metric, nested) and OmniX.
//!
//! Source: `spec/da3.md` sections 1 to 8, 12, 17, 18 and `spec/omnix.md` sections 1 and 3 to 9. This crate *records* into an
//! [`omnix_graph::Graph`]; it computes nothing but tables that depend on sizes alone. Two graphs make geometry: the backbone
//! over all views of a scene ([`Network::backbone`], cameras included), and the head over a chunk of frames
//! ([`Network::head`]), since frames do not see each other there. Three more make trajectories: the spatiotemporal module over
//! all images ([`Network::motion`]: features and points to a field), the sampling head over a chunk of frames
//! ([`Network::sampling`]: where pixels read it), and the evaluation of one source image ([`fn@trajectory`]).
//!
//! Layouts: tokens `[view · token, channel]`, token 0 of a view first, then patches row-major; maps `[frame, row, column,
//! channel]`. Values carry the names of the recorded references (`tok.block3`, `head.fuse2_aux`), so that a graph with
//! taps shows its inside. What the OmniX references call `backbone.block0` and `feat.k.camera` is `tok.block0` and
//! `feat.k.cam` here; their `out.pose_encoding` is `cam.pose_enc`, `traj.mask`, `head.offsets` and `head.weights` are
//! `mask`, `offsets` and `weights`, `out.token_score` is `traj.score`.
//!
//! A nested network is two: [`Network::metric`] is the second, with graphs of its own; what their results become together is
//! [`omnix_geometry::metric_scale`].

pub mod backbone;
mod block;
mod camera;
pub mod config;
mod dpt;
mod error;
mod layers;
mod manifest;
mod motion;
mod network;
mod rope;
mod sampling;
mod training;
mod trajectory;

pub use backbone::{BackboneOutputs, BackboneSpec, Reference, ReferenceChoice};
pub use config::NetworkConfig;
pub use dpt::{HeadOutputs, HeadSpec};
pub use error::ModelError;
pub use manifest::{Parts, manifest};
pub use motion::{DRAW, Dropout, FORCED, MotionOutputs, MotionSpec};
pub use network::Network;
pub use sampling::{SamplingOutputs, SamplingSpec};
pub use training::{TimeCode, TrainingMotion, TrainingOutputs, TrainingSpec};
pub use trajectory::{TrajectoryOutputs, TrajectorySpec, trajectory};

/// Side of a patch in pixels; picture sides are multiples of it.
pub const PATCH: usize = 14;
