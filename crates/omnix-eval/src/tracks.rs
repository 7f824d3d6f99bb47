//! 3D point tracks against their truth: APD (share of points within distances, averaged over them) and EPE (mean distance).
//!
//! * [`tapvid3d`]: the metrics of the TAPVid-3D benchmark, in the camera of each time.
//! * [`world`]: sparse tracks in the frame of the first camera, as St4RTrack scores them.
//! * [`dense`]: trajectories of all pixels of several source images, the paper's own benchmark.
//!
//! Points are metres, `[time][track]`, row-major.

pub mod dense;
mod points;
pub mod tapvid3d;
pub mod world;

pub use points::{METRIC_RESOLUTION, PIXELS, Thresholds, mean_focal};
