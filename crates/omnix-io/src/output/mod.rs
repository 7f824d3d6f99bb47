//! Results out: one [`Sink`] for each export format, fed one image at a time.
//!
//! No sink holds all depth maps: arrays and points are spooled to unnamed temporary files in the output folder or reduced to a
//! bounded, seeded sample. Files appear under their final names only when whole. Files of the same names are replaced, no other
//! file is touched. When a run is interrupted, [`Sink::finish`] is called all the same and what was finished is readable.

mod atomic;
mod camera;
mod choose;
mod colour;
mod depth;
pub mod field;
mod glb;
mod glb_motion;
mod gltf;
pub mod html;
pub mod manifest;
mod masks;
pub mod motion;
mod motion_out;
mod npy;
mod npz;
mod omx4d;
pub mod paths;
mod ply;
mod sample;
mod st4rtrack;
mod tracks;
mod tum;
mod voxel;

use std::{
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

pub use atomic::check_output_folder;
pub use choose::{PointOptions, choose_points};
pub use colour::spectral;
pub use glb_motion::{GlbMotionOptions, write_glb_motion};
pub use motion_out::{MotionInput, MotionOptions, MotionStream, write_motion};
pub use omx4d::{Omx4dOptions, write_omx4d};
pub use voxel::{VoxelChoice, VoxelOptions, choose_voxel};

use crate::IoError;

/// An export format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Export {
    /// `exports/npz/results.npz`: pictures, depth, confidence, cameras.
    Npz,
    /// `exports/mini_npz/results.npz`: the same without pictures, depth with more decimals.
    MiniNpz,
    /// `depth/NNNNNN.png` (16 bit) and `depth_color/NNNNNN.png`.
    Depth,
    /// `points.ply`.
    Ply,
    /// `scene.glb`; with points that move where the network has motion.
    Glb,
    /// `trajectory.tum` and `frame_times.csv`.
    Tum,
    /// `exports/tracks/NNNNNN.npz`: paths of points, one archive a source image.
    Tracks,
    /// `exports/st4rtrack/`: the folder that St4RTrack's viewer reads.
    St4rtrack,
    /// `scene.omx4d`: moving points for web viewers.
    Omx4d,
    /// `masks/NNNNNN.png` and `theta/NNNNNN.png`: which pixels move, and how surely.
    Masks,
    /// `scene.html`: a viewer of moving points in one file.
    Html,
    /// `field.safetensors`: what paths of points are evaluated from, whole.
    Field,
}

const EXPORTS: [Export; 12] = [
    Export::Npz,
    Export::MiniNpz,
    Export::Depth,
    Export::Ply,
    Export::Glb,
    Export::Tum,
    Export::Tracks,
    Export::St4rtrack,
    Export::Omx4d,
    Export::Masks,
    Export::Html,
    Export::Field,
];

impl Export {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::MiniNpz => "mini_npz",
            Self::Depth => "depth",
            Self::Ply => "ply",
            Self::Glb => "glb",
            Self::Tum => "tum",
            Self::Tracks => "tracks",
            Self::St4rtrack => "st4rtrack",
            Self::Omx4d => "omx4d",
            Self::Masks => "masks",
            Self::Html => "html",
            Self::Field => "field",
        }
    }

    /// Whether it needs extrinsics and intrinsics, so that a network without cameras can be refused before the run.
    #[must_use]
    pub fn needs_cameras(self) -> bool {
        matches!(self, Self::Ply | Self::Glb | Self::Tum) || self.needs_motion()
    }

    /// A list such as "npz,glb" (or "npz-glb", as the reference writes it), in its order, repeats dropped.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parse_list(list: &str) -> Result<Vec<Self>, IoError> {
        let mut exports = Vec::new();
        for name in list.split([',', '-']).map(str::trim).filter(|n| !n.is_empty()) {
            let export = name.parse()?;
            if !exports.contains(&export) {
                exports.push(export);
            }
        }
        Ok(exports)
    }
}

impl FromStr for Export {
    type Err = IoError;

    fn from_str(name: &str) -> Result<Self, IoError> {
        EXPORTS.into_iter().find(|e| e.name() == name).ok_or_else(|| IoError::UnknownName {
            what: "export",
            name: name.to_owned(),
            known: "npz, mini_npz, depth, ply, glb, tum, tracks, st4rtrack, omx4d, masks, html, field",
        })
    }
}

impl fmt::Display for Export {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The result of one image. Maps are row-major, `[height][width]`.
#[derive(Debug, Clone, Copy)]
pub struct FrameResult<'a> {
    /// Global index of the image; sinks get images in ascending order.
    pub index: usize,
    /// Video index.
    pub video: u32,
    /// Frame number in its video.
    pub frame: u32,
    /// Presentation time in seconds, if the input has one.
    pub time_s: Option<f64>,
    /// Width of all maps in pixels.
    pub width: u32,
    /// Height of all maps in pixels.
    pub height: u32,
    /// Depth along the camera's z axis, in the run's unit.
    pub depth: &'a [f32],
    /// Confidence, at least 1 for Depth Anything 3.
    pub confidence: Option<&'a [f32]>,
    /// The processed picture, 8-bit RGB, interleaved.
    pub rgb: &'a [u8],
    /// World-to-camera `[R|t]`, OpenCV axes.
    pub extrinsics: Option<[[f32; 4]; 3]>,
    /// Intrinsics in pixels of these maps, pixel positions at whole numbers.
    pub intrinsics: Option<[[f32; 3]; 3]>,
    /// Pixels that are sky; no points are made of them.
    pub sky: Option<&'a [bool]>,
}

impl FrameResult<'_> {
    /// Checks the length of every buffer.
    fn check(&self, export: Export) -> Result<(), IoError> {
        let pixels = self.width as usize * self.height as usize;
        let lengths = [
            ("depth", self.depth.len(), pixels),
            ("confidence", self.confidence.map_or(pixels, <[f32]>::len), pixels),
            ("picture", self.rgb.len(), 3 * pixels),
            ("sky", self.sky.map_or(pixels, <[bool]>::len), pixels),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(IoError::WrongSize { export: export.name(), what, index: self.index, expected, found });
            }
        }
        Ok(())
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RunSummary {
    /// Whether it was stopped before its last image.
    pub interrupted: bool,
}

/// Receives results, one image at a time in ascending order, and writes one export format.
pub trait Sink: Send {
    /// The format.
    fn export(&self) -> Export;

    /// Takes the result of one image.
    ///
    /// # Errors
    /// A full disk or other failure of writing; a camera missing where the format needs one; buffers of a wrong length.
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError>;

    /// Completes the files and returns their paths. Without a single image there are none.
    ///
    /// # Errors
    /// A full disk or other failure of writing; then no file of that format appears that is not whole.
    fn finish(self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError>;
}

/// Settings of the sinks.
#[derive(Debug, Clone, PartialEq)]
pub struct SinkOptions {
    /// `ply`: leave out points below this percentile of confidence (0 to 100).
    pub ply_confidence_percentile: Option<f32>,
    /// `ply`: keep at most this many points, spread evenly over all of them.
    pub ply_max_points: Option<usize>,
    /// `glb`: percentile of the threshold rule `min(max(1.05, p), p90)`.
    pub glb_confidence_percentile: f32,
    /// `glb`: at most this many points (and 100 million), a seeded random choice.
    pub glb_max_points: usize,
    /// `glb`: draw the cameras.
    pub show_cameras: bool,
    /// Seed of every random choice.
    pub seed: u64,
    /// Name of the unit of length for the files' headers.
    pub unit: String,
}

impl Default for SinkOptions {
    fn default() -> Self {
        Self {
            ply_confidence_percentile: None,
            ply_max_points: None,
            glb_confidence_percentile: 40.0,
            glb_max_points: 1_000_000,
            show_cameras: true,
            seed: 42,
            unit: "network scale (not metric)".into(),
        }
    }
}

/// An error unless it is a number of images a second.
fn check_rate(fps: f64) -> Result<(), IoError> {
    if fps.is_finite() && fps > 0.0 {
        return Ok(());
    }
    Err(IoError::BadChoice { reason: format!("{fps} images a second cannot be played") })
}

/// Makes the output folder, proves that it can be written to, and opens one sink for each export that is made of single images' results;
/// those that need motion are written by [`write_motion`] and [`MotionStream`].
///
/// # Errors
/// A folder that cannot be made or written to: found here, before any work.
pub fn open_sinks(exports: &[Export], dir: &Path, options: &SinkOptions) -> Result<Vec<Box<dyn Sink>>, IoError> {
    check_output_folder(dir)?;
    let mut sinks: Vec<Box<dyn Sink>> = Vec::with_capacity(exports.len());
    for &export in exports {
        sinks.push(match export {
            Export::Npz => Box::new(npz::NpzSink::new(dir, npz::Layout::Full)),
            Export::MiniNpz => Box::new(npz::NpzSink::new(dir, npz::Layout::Mini)),
            Export::Depth => Box::new(depth::DepthSink::new(dir, options)),
            Export::Ply => Box::new(ply::PlySink::new(dir, options)?),
            Export::Glb => Box::new(glb::GlbSink::new(dir, options)),
            Export::Tum => Box::new(tum::TumSink::new(dir)),
            Export::Tracks | Export::St4rtrack | Export::Omx4d | Export::Masks | Export::Html | Export::Field => {
                continue;
            }
        });
    }
    Ok(sinks)
}
