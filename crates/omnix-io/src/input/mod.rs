//! Inputs in two phases: [`probe`] turns command-line inputs into a list of frames without keeping a picture, [`FrameLoader`]
//! decodes them one at a time to 8-bit RGB.
//!
//! Each input is a video of its own: a picture (one frame), a folder of pictures, a pattern, or a video file. A folder with
//! sub-folders is one video for each sub-folder, and the video index counts folders, empty ones too (`omnix.md` section 2,
//! rule 1). Names are sorted as people count ("9.png" before "10.png"; the reference sorts them as text); hidden files and folders
//! are passed over, and what else is not read is said. Pictures are turned upright as EXIF says, videos as their container
//! says, and pixels of videos that are not square are made so.

mod child;
mod choice;
mod container;
mod decoded;
mod ffmpeg;
mod header;
mod jpeg;
mod jpeg_bits;
mod kinds;
mod loader;
mod options;
mod picture;
mod plan;
mod probing;
mod sources;
mod spool;
mod video;

pub use choice::FrameChoice;
pub(crate) use ffmpeg::ffmpeg_program;
pub use header::image_size;
pub use kinds::{IMAGE_EXTENSIONS, VIDEO_EXTENSIONS, is_video};
pub(crate) use kinds::{is_hidden, is_image};
pub use loader::FrameLoader;
pub use options::{ReadOptions, Stop};
pub use picture::{Picture, load_picture};
pub(crate) use picture::{not_black, opaque};
pub use plan::{InputPlan, PlannedFrame, Source, SourceKind};
pub use probing::{probe, probe_with};
pub use spool::PictureSpool;
pub use video::{Damage, VideoInfo, probe_video};
