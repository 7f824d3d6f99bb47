//! Settings of the exports.

use omnix_geometry::NETWORK_UNIT;

use crate::IoError;
use crate::setters::settings;

settings! {
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
            unit: NETWORK_UNIT.into(),
        }
    }
}

settings! {
    /// Settings of the exports of motion.
    #[derive(Clone, Debug, PartialEq)]
    pub struct MotionOptions {
        /// Name of the scene in files that have one.
        pub name: String,
        /// Images a second in files that play.
        pub fps: f64,
        /// `glb`.
        pub glb: GlbMotionOptions,
        /// `omx4d`.
        pub omx4d: Omx4dOptions,
        /// `html`.
        pub html: HtmlOptions,
    }
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            name: "scene".into(),
            fps: 12.0,
            glb: GlbMotionOptions::default(),
            omx4d: Omx4dOptions::default(),
            html: HtmlOptions::default(),
        }
    }
}

settings! {
    /// Settings of `glb` with moving points.
    #[derive(Clone, Debug, PartialEq)]
    pub struct GlbMotionOptions {
        /// At most this many points.
        pub max_points: usize,
        /// At most this many key times, at least 2.
        pub max_times: usize,
        /// Draw and animate the cameras.
        pub show_cameras: bool,
        /// Name of the unit of length for the file's header.
        pub unit: String,
    }
}

impl Default for GlbMotionOptions {
    fn default() -> Self {
        Self { max_points: 200_000, max_times: 32, show_cameras: true, unit: NETWORK_UNIT.into() }
    }
}

settings! {
    /// Settings of `omx4d`.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct Omx4dOptions {
        /// Which of the offered points are written.
        pub voxel: VoxelOptions,
        /// The number of leading images whose points are written; `None` for all. This leaves out copies that fill up a batch.
        pub candidate_views: Option<usize>,
        /// Colour by source image and motion instead of the pictures.
        pub palette: bool,
        /// Camera-to-world matrices of the images as the network gave them; without them the extrinsics are inverted.
        pub camera_to_world: Option<Vec<[[f32; 4]; 3]>>,
    }
}

settings! {
    /// How many points, and how they are shared out.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct VoxelOptions {
        /// Number of points wanted.
        pub budget: usize,
        /// Share of them for the highest scores, 0 to 1.
        pub reserve: f64,
        /// Lowest score for that share.
        pub threshold: f64,
    }
}

impl Default for VoxelOptions {
    fn default() -> Self {
        Self { budget: 100_000, reserve: 0.8, threshold: 0.0 }
    }
}

settings! {
    /// What the page says, and how large its pictures are.
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct HtmlOptions {
        /// Title of the page, plain text.
        pub title: String,
        /// Paragraphs for the page's information, plain text.
        pub notes: Vec<String>,
        /// Name of the unit of length.
        pub unit: String,
        /// Width of the views' pictures in the page, in pixels; smaller ones are kept as they are.
        pub thumbnail_width: u32,
        /// JPEG quality of these pictures, 1 to 100.
        pub jpeg_quality: u8,
    }
}

impl Default for HtmlOptions {
    fn default() -> Self {
        Self {
            title: "omnix".into(),
            notes: Vec::new(),
            unit: NETWORK_UNIT.into(),
            thumbnail_width: 320,
            jpeg_quality: 80,
        }
    }
}

/// An error unless it is a number of images per second.
pub(super) fn check_rate(fps: f64) -> Result<(), IoError> {
    if fps.is_finite() && fps > 0.0 {
        return Ok(());
    }
    Err(IoError::BadChoice { reason: format!("{fps} images a second cannot be played") })
}
