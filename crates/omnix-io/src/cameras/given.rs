//! A camera as a file gives it, and the text of such files.

use std::path::{Path, PathBuf};

use super::lens::Lens;
use crate::IoError;

/// Which picture a camera is of.
#[derive(Debug, Clone, PartialEq)]
pub enum PictureKey {
    /// A name, perhaps with folders in front, and perhaps without an ending.
    Name(String),
    /// A time in seconds.
    Time(f64),
}

/// A camera as a file gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenCamera {
    /// Its picture.
    pub picture: PictureKey,
    /// Width and height of the picture that the lens is for; that of the picture itself where the file does not say.
    pub size: Option<[u32; 2]>,
    /// The lens.
    pub lens: Lens,
    /// World-to-camera `[R|t]`, OpenCV axes.
    pub world_to_camera: [[f32; 4]; 3],
}

/// Cameras of one file or model.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenCameras {
    /// Each once.
    pub cameras: Vec<GivenCamera>,
    /// The name of the format.
    pub format: &'static str,
    /// Where they were read.
    pub path: PathBuf,
}

/// Bytes of a text file of cameras at most; a line of a thousand bytes for each of a hundred thousand pictures.
const LONGEST: u64 = 100 << 20;

/// The text of a file of cameras.
pub(super) fn text(path: &Path) -> Result<String, IoError> {
    omnix_tensors::read_text(path, LONGEST)
        .map_err(|error| IoError::BadCameras { reason: error.to_string(), path: path.to_owned() })
}
