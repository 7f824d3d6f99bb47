//! Results out: one [`Sink`] for each export format, fed one image at a time.
//!
//! No sink holds all depth maps: arrays and points are spooled to unnamed temporary files in the output folder or reduced to a
//! bounded, seeded sample. Files appear under their final names only when whole. Files of the same names are replaced, no other
//! file is touched. When a run is interrupted, [`Sink::finish`] is called all the same and what was finished is readable.
//!
//! Each format's file states what the format is (`format.rs`); `export.rs` has the one list of them.

mod atomic;
mod camera;
mod choose;
mod colmap;
mod colour;
mod csv;
mod depth;
mod export;
mod exr;
mod features;
pub mod field;
mod film;
mod folder;
mod format;
mod frame;
mod glb;
mod glb_layout;
mod glb_motion;
mod gltf;
mod gs_ply;
pub mod html;
pub mod manifest;
mod masks;
pub mod motion;
mod motion_export;
mod npy;
mod npz;
mod omx4d;
mod options;
pub mod paths;
mod ply;
mod ply_seq;
mod preview;
mod sample;
mod saved_field;
mod st4rtrack;
mod tracks;
mod transforms;
mod tum;
mod usda;
mod voxel;

pub use atomic::check_output_folder;
pub use choose::{PointOptions, choose_points};
pub use colour::spectral;
pub use export::{Export, MotionInput, open_sinks, part_folder};
pub use film::{Film, write_png};
pub use folder::{OutputFolder, WINDOWS};
pub use format::RunSize;
pub use frame::{FeatureMap, FrameResult, RunSummary, Sink, SourcePicture};
pub use glb_motion::write_glb_motion;
pub use motion_export::{MotionStream, write_motion};
/// For a program that ends at once: removes files in the making.
pub use omnix_tensors::abandon;
pub use omx4d::write_omx4d;
pub use options::{GlbMotionOptions, HtmlOptions, MotionOptions, Omx4dOptions, SinkOptions, VoxelOptions};
pub use voxel::{VoxelChoice, choose_voxel};
