//! What an export format is. Each format's file states its own [`Format`]; `export.rs` lists them. Everything that a program
//! asks of a format before, during and after a run follows from that one statement: its name, what it takes, the files it
//! leaves and what they contain, the bytes it takes on disk and in memory, and the functions that write it.

use std::path::{Path, PathBuf};

use super::frame::Sink;
use super::motion::{MotionView, MovingPoints, SourceMotion};
use super::options::{MotionOptions, SinkOptions};
use crate::IoError;
use crate::setters::settings;

/// An export format, as its own file states it.
#[derive(Debug)]
pub(super) struct Format {
    /// Its name on the command line.
    pub(super) name: &'static str,
    /// Whether it needs extrinsics and intrinsics.
    pub(super) needs_cameras: bool,
    /// Whether it states lenses of the source pictures, which then must have no distortion.
    pub(super) states_source_lenses: bool,
    /// Whether it needs a network with trajectories.
    pub(super) needs_motion: bool,
    /// Whether it needs a network with a Gaussian head.
    pub(super) needs_gaussians: bool,
    /// Whether it needs features of the encoder.
    pub(super) needs_features: bool,
    /// Whether it can say that a point is lost: positions that are NaN from some time on.
    pub(super) loses_points: bool,
    /// Whether a run writes it that names no exports.
    pub(super) by_default: bool,
    /// The files it leaves.
    pub(super) files: &'static [FileKind],
    /// Bytes it takes on disk, roughly and rather too many: pictures and archives as if they did not shrink.
    pub(super) disk: fn(&RunSize) -> u64,
    /// Bytes of host memory it takes at most while its file is put together, beside the pictures.
    pub(super) memory: fn(&RunSize) -> u64,
    /// Opens it for the results of single images, if it is made of these.
    pub(super) frames: Option<OpenSink>,
    /// Writes it from chosen points of all images at all times, if it is made of these.
    pub(super) points: Option<WritePoints>,
    /// Writes one source image's part of it from all pixels of that image, if it is made of these.
    pub(super) images: Option<ImageWriter>,
}

/// Opens a format in an output folder.
pub(super) type OpenSink = fn(&Path, &SinkOptions) -> Result<Box<dyn Sink>, IoError>;
/// Writes a format into an output folder, and returns the paths of its files.
pub(super) type WritePoints = fn(&Path, &MovingPoints, &MotionOptions) -> Written;
/// Writes one image's part of a format into an output folder, and returns the paths of its files.
pub(super) type WriteImage = fn(&Path, &[MotionView], &SourceMotion<'_>) -> Written;
type Written = Result<Vec<PathBuf>, IoError>;

impl Format {
    /// A format that takes and leaves nothing, for `..Format::NONE`.
    pub(super) const NONE: Self = Self {
        name: "",
        needs_cameras: false,
        states_source_lenses: false,
        needs_motion: false,
        needs_gaussians: false,
        needs_features: false,
        loses_points: false,
        by_default: false,
        files: &[],
        disk: |_| 0,
        memory: |_| 0,
        frames: None,
        points: None,
        images: None,
    };
}

/// How a format is written one source image at a time.
#[derive(Debug)]
pub(super) struct ImageWriter {
    /// Writes one image's part.
    pub(super) write: WriteImage,
    /// Whether the image of this index must come with the paths of its pixels.
    pub(super) wants_trajectory: fn(usize) -> bool,
}

/// A kind of file that a format leaves.
#[derive(Debug)]
pub(super) struct FileKind {
    /// Its name from the output folder, with forward slashes; where there are several of a kind, [`NUMBER`] or [`PLAIN`] stands
    /// for their number.
    pub(super) name: &'static str,
    /// When there is such a file, and how many.
    pub(super) each: Each,
    /// What it contains, for the manifest.
    pub(super) contains: &'static str,
    /// Where its points come from, if it holds any.
    pub(super) points: Points,
}

impl FileKind {
    /// One file a run, without points.
    pub(super) const fn one(name: &'static str, contains: &'static str) -> Self {
        Self { name, each: Each::Run, contains, points: Points::None }
    }

    /// One file an image, without points.
    pub(super) const fn of_images(name: &'static str, contains: &'static str) -> Self {
        Self { name, each: Each::Image, contains, points: Points::None }
    }

    /// The same with points.
    pub(super) const fn with(self, points: Points) -> Self {
        Self { points, ..self }
    }

    /// Whether `name` (from the output folder, forward slashes) is a file of this kind.
    pub(super) fn matches(&self, name: &str) -> bool {
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        for (mark, width) in [(NUMBER, 6), (PLAIN, 1)] {
            if let Some((before, after)) = self.name.split_once(mark) {
                let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
                return number.is_some_and(|n| digits(n) && n.len() >= width);
            }
        }
        name == self.name
    }

    /// The name of the file of this number.
    pub(super) fn numbered(&self, number: usize) -> String {
        self.name.replace(NUMBER, &format!("{number:06}")).replace(PLAIN, &number.to_string())
    }

    /// How many such files a run of this size leaves at most.
    pub(super) fn count(&self, size: &RunSize) -> usize {
        match self.each {
            Each::Run => 1,
            Each::StillRun => usize::from(!size.motion),
            Each::MovingRun => usize::from(size.motion),
            Each::Image => size.images as usize,
            Each::Window => size.windows as usize,
            Each::OnlyVideo => usize::from(size.videos == 1),
            Each::Video => {
                if size.videos > 1 {
                    size.videos as usize
                } else {
                    0
                }
            }
        }
    }
}

/// Stands for a number of six digits or more in the name of a file.
pub(super) const NUMBER: &str = "NNNNNN";
/// Stands for a number without leading zeros.
pub(super) const PLAIN: &str = "{n}";

/// When there is a file of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Each {
    /// One a run.
    Run,
    /// One a run without motion.
    StillRun,
    /// One a run with motion.
    MovingRun,
    /// One per image, numbered as images are.
    Image,
    /// One a window of a film in windows, numbered as windows are.
    Window,
    /// One, if there is one video.
    OnlyVideo,
    /// One a video, if there are several.
    Video,
}

/// Where the points in a file come from. The two can differ by several pixels where a network has not learned to agree with
/// itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Points {
    /// It holds none.
    None,
    /// Each pixel's depth, unprojected with the exported camera.
    DepthAndCamera,
    /// The network's own world points, which trajectories start at.
    Network,
}

settings! {
    /// How large a run is, for what its exports will leave and take.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct RunSize {
        /// Number of images.
        pub images: u64,
        /// Number of videos.
        pub videos: u64,
        /// Number of windows of a film in windows.
        pub windows: u64,
        /// Pixels of an image.
        pub pixels: u64,
        /// Whether trajectories are made.
        pub motion: bool,
        /// Points in files of still points at most, where that is bounded.
        pub points: Option<u64>,
        /// Points that exports of motion follow at most.
        pub followed: u64,
        /// Whether exports that can are to follow every pixel.
        pub all_pixels: bool,
        /// Bytes of the encoder's features of all images.
        pub feature_bytes: u64,
        /// Bytes of a saved field.
        pub field_bytes: u64,
    }
}

impl RunSize {
    /// Pixels of all images.
    pub(super) fn all(&self) -> u64 {
        self.images.saturating_mul(self.pixels)
    }

    /// Points of a still file: at most `limit`, if nothing else is asked for.
    pub(super) fn still(&self, limit: u64) -> u64 {
        self.points.unwrap_or(limit).min(self.all())
    }

    /// Points that are followed.
    pub(super) fn moving(&self) -> u64 {
        self.followed.min(self.all())
    }

    /// `bytes` for each image and `more` once, for each of `count` points.
    pub(super) fn paths(&self, count: u64, bytes: u64, more: u64) -> u64 {
        count.saturating_mul(self.images.saturating_mul(bytes).saturating_add(more))
    }

    /// Bytes of the followed points' positions at all times, held as often as `quarters` of once.
    pub(super) fn path_memory(&self, quarters: u64) -> u64 {
        (self.paths(self.moving(), 12, 0) / 4).saturating_mul(quarters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_a_kind() {
        let padded = FileKind::of_images("depth/NNNNNN.png", "");
        assert_eq!([padded.numbered(7), padded.numbered(1_234_567)], ["depth/000007.png", "depth/1234567.png"]);
        let plain = FileKind::of_images("exports/conf1_p{n}.npy", "");
        assert_eq!(plain.numbered(7), "exports/conf1_p7.npy");
        for (kind, name, yes) in [
            (&padded, "depth/000007.png", true),
            (&padded, "depth/1234567.png", true),
            (&padded, "depth/7.png", false),
            (&padded, "depth/mine00.png", false),
            (&padded, "depth/000007.png.bak", false),
            (&plain, "exports/conf1_p12.npy", true),
            (&plain, "exports/conf1_p.npy", false),
        ] {
            assert_eq!(kind.matches(name), yes, "{} {name}", kind.name);
        }
    }

    #[test]
    fn sizes_do_not_overflow() {
        let huge = RunSize { images: u64::MAX, pixels: u64::MAX, followed: u64::MAX, ..RunSize::default() };
        assert_eq!(huge.paths(huge.all(), 12, 12), u64::MAX);
    }
}
