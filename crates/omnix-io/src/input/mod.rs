//! Inputs in two phases: [`probe`] turns command-line inputs into a list of frames without decoding a pixel,
//! [`FrameLoader`] decodes them one at a time to 8-bit RGB.
//!
//! Each input is a video of its own: a picture (one frame), a folder of pictures, a pattern, or a video file. A folder with
//! sub-folders is one video for each sub-folder, and the video index counts folders, empty ones too (`omnix.md` section 2,
//! rule 1). Names are sorted as text, so "10.png" comes before "9.png". Nothing is rotated by EXIF; videos are rotated as
//! their container says.

mod choice;
mod ffmpeg;
mod header;
mod loader;
mod picture;
mod sources;
mod video;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::IoError;
pub use choice::FrameChoice;
pub use header::image_size;
pub use loader::FrameLoader;
pub use picture::{Picture, load_picture};
pub use video::{VideoInfo, probe_video};

/// Extensions read as pictures, lower case.
pub const IMAGE_EXTENSIONS: &[&str] = &["png", "jpg", "jpeg", "webp", "bmp"];
/// Extensions handed to ffmpeg, lower case.
pub const VIDEO_EXTENSIONS: &[&str] = &["mp4", "mov", "avi", "mkv", "webm", "m4v", "flv", "wmv"];

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
    /// Width in pixels, as decoded (videos: after rotation).
    pub width: u32,
    /// Height in pixels, as decoded.
    pub height: u32,
}

/// Every frame of a run, known before anything is decoded.
#[derive(Debug, Clone)]
pub struct InputPlan {
    /// The videos, in order of the inputs.
    pub sources: Vec<Source>,
    /// The chosen frames, video by video.
    pub frames: Vec<PlannedFrame>,
    /// Remarks a user should see: files left aside, a rate that could not be applied.
    pub notes: Vec<String>,
}

/// Lists the frames of all inputs, reading file headers only.
///
/// `choice` applies to each video by itself. Pictures carry no times: for them [`FrameChoice::Fps`] keeps every frame, and a
/// note says so.
///
/// # Errors
/// An input that does not exist, has no frames, is of an unknown type, is not what its name says, or is cut off; ffprobe
/// missing when an input is a video; a choice of no frames.
pub fn probe<P: AsRef<Path>>(inputs: &[P], choice: FrameChoice) -> Result<InputPlan, IoError> {
    choice.check()?;
    let mut plan = InputPlan { sources: Vec::new(), frames: Vec::new(), notes: Vec::new() };
    for input in inputs {
        sources::resolve(input.as_ref(), &mut plan.sources, &mut plan.notes)?;
    }
    let mut frames = Vec::new();
    let mut untimed = 0usize;
    for source in &plan.sources {
        match &source.kind {
            SourceKind::Images(files) => {
                untimed += usize::from(files.len() > 1);
                for (frame, number) in choice.pick(files.len(), None).into_iter().enumerate() {
                    frames.push(PlannedFrame {
                        index: 0,
                        video: source.video,
                        frame: frame as u32,
                        source_frame: number as u32,
                        time_s: None,
                        path: files[number].clone(),
                        width: 0,
                        height: 0,
                    });
                }
            }
            SourceKind::Video(info) => {
                let picked = choice.pick(info.times_s.len(), Some(&info.times_s));
                for (frame, number) in picked.into_iter().enumerate() {
                    frames.push(PlannedFrame {
                        index: 0,
                        video: source.video,
                        frame: frame as u32,
                        source_frame: number as u32,
                        time_s: Some(info.times_s[number]),
                        path: source.path.clone(),
                        width: info.width,
                        height: info.height,
                    });
                }
            }
        }
    }
    if matches!(choice, FrameChoice::Fps(_)) && untimed > 0 {
        plan.notes.push(format!(
            "pictures carry no times, so the frame rate was not applied to {untimed} folder(s): all of their pictures are used"
        ));
    }
    // Thousands of small reads: in parallel they take well under a second even on a cold cache.
    frames.par_iter_mut().enumerate().try_for_each(|(index, frame)| {
        frame.index = index;
        if frame.width == 0 {
            (frame.width, frame.height) = image_size(&frame.path)?;
        }
        Ok::<(), IoError>(())
    })?;
    if frames.is_empty() {
        let path = inputs.first().map_or_else(PathBuf::new, |input| input.as_ref().to_owned());
        return Err(IoError::NoFrames { found: "no inputs".into(), path });
    }
    plan.frames = frames;
    Ok(plan)
}

/// The extension in lower case, without the dot; empty if there is none.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

pub(crate) fn is_image(path: &Path) -> bool {
    IMAGE_EXTENSIONS.contains(&extension(path).as_str())
}

pub(crate) fn is_video(path: &Path) -> bool {
    VIDEO_EXTENSIONS.contains(&extension(path).as_str())
}
