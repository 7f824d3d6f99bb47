//! Every frame of a run, known before a picture is decoded.

use std::ffi::OsStr;
use std::path::PathBuf;

use super::video::VideoInfo;

/// Where the frames of one video come from.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum SourceKind {
    /// Picture files in order; empty for an empty sub-folder.
    Images(Vec<PathBuf>),
    /// A video file.
    Video(VideoInfo),
}

/// One video: a picture, a folder, a pattern's matches or a video file.
#[derive(Debug, Clone)]
pub struct Source {
    /// The command-line input it came from, as given.
    pub input: PathBuf,
    /// The picture, folder or video file; the pattern itself for a pattern.
    pub path: PathBuf,
    /// Video index: position in [`InputPlan::sources`].
    pub video: u32,
    /// Its frames, before the choice.
    pub kind: SourceKind,
}

/// One frame that will be read.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedFrame {
    /// Global index: position in [`InputPlan::frames`], and the global time of `omnix.md`.
    pub index: usize,
    /// Video index (counts sources, empty ones too).
    pub video: u32,
    /// Position among the chosen frames of its video, from 0: the frame number of the time codes.
    pub frame: u32,
    /// Number of the frame in its file or folder, from 0, before the choice.
    pub source_frame: u32,
    /// Presentation time in seconds; none for pictures, which carry no times.
    pub time_s: Option<f64>,
    /// The picture, or the video file.
    pub path: PathBuf,
    /// Width in pixels, upright, of square pixels.
    pub width: u32,
    /// Height in pixels, upright, of square pixels.
    pub height: u32,
    /// Bytes that reading it takes at most, until it is an 8-bit RGB picture, that one included.
    pub bytes: u64,
}

/// Every frame of a run, known before a picture is decoded.
#[derive(Debug, Clone)]
pub struct InputPlan {
    /// The videos, in order of the inputs.
    pub sources: Vec<Source>,
    /// The chosen frames, video by video.
    pub frames: Vec<PlannedFrame>,
    /// Remarks a user should see: files left aside, damaged videos, a choice that could not be applied.
    pub notes: Vec<String>,
}

impl InputPlan {
    /// A name for each frame's picture, as files for other tools state it: the picture's own, or `VIDEO_NNNNNN.png` with the frame's number in
    /// its video; behind the number of its input, or else of its image, and a slash where names are equal.
    #[must_use]
    pub fn picture_names(&self) -> Vec<String> {
        let is_video = |number: u32| {
            self.sources.iter().any(|source| source.video == number && matches!(source.kind, SourceKind::Video(_)))
        };
        let name = |frame: &PlannedFrame| {
            let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
            if is_video(frame.video) {
                format!("{}_{:06}.png", part(frame.path.file_stem()), frame.source_frame)
            } else {
                part(frame.path.file_name())
            }
        };
        let names: Vec<String> = self.frames.iter().map(name).collect();
        let unique = |names: &[String]| {
            let mut sorted: Vec<&String> = names.iter().collect();
            sorted.sort_unstable();
            sorted.windows(2).all(|pair| pair[0] != pair[1])
        };
        if unique(&names) {
            return names;
        }
        let with_video: Vec<String> =
            names.iter().zip(&self.frames).map(|(name, frame)| format!("{}/{name}", frame.video)).collect();
        if unique(&with_video) {
            return with_video;
        }
        // A pattern may match pictures of several folders.
        names.iter().zip(&self.frames).map(|(name, frame)| format!("{:06}/{name}", frame.index)).collect()
    }

    /// The frame that takes the most memory to read.
    #[must_use]
    pub fn largest(&self) -> Option<&PlannedFrame> {
        self.frames.iter().max_by_key(|f| f.bytes)
    }
}
