//! Images and videos in, reconstructions out; no device anywhere in this crate.
//!
//! * [`input`]: command-line inputs to a plan of frames, then to 8-bit RGB pictures one at a time.
//! * [`preprocess`]: pictures to the network's input, for Depth Anything 3 (`da3.md` section 3) and OmniX
//!   (`omnix.md` section 2).
//! * [`cameras`]: known cameras, as other tools write them.
//! * [`masks`]: pictures that say something of each pixel of others.
//! * [`output`]: one sink for each export format, fed one image at a time, and the manifest of a run.
//!
//! Cameras are plain arrays here: extrinsics world-to-camera `[[f32; 4]; 3]` (OpenCV axes), intrinsics `[[f32; 3]; 3]`
//! in pixels of the processed picture, with pixel positions at whole numbers as the reference's exports have them.

pub mod cameras;
mod error;
pub mod input;
pub mod masks;
pub mod output;
pub mod preprocess;
mod setters;

pub use error::IoError;
pub use input::{
    FrameChoice, FrameLoader, InputPlan, Picture, PictureSpool, PlannedFrame, ReadOptions, Stop, probe, probe_with,
};
pub use output::{Export, FrameResult, RunSize, RunSummary, Sink, SinkOptions, manifest::write_manifest, open_sinks};
