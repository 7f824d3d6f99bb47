//! Known cameras: what other tools say of the pictures, read and matched to the frames of a run.
//!
//! | file | source | pose | pixels |
//! |---|---|---|---|
//! | COLMAP model (`cameras` and `images`, `.txt` or `.bin`) | COLMAP's documentation, "Output format" | world-to-camera | corner of the first pixel at (0, 0) |
//! | `transforms.json` | nerfstudio and instant-ngp | camera-to-world, y up and z back | the same |
//! | TUM trajectory with `intrinsics.txt` beside it | TUM RGB-D benchmark, "File formats" | camera-to-world, OpenCV axes | centre of the first pixel at (0, 0) |
//!
//! All leave here with OpenCV axes (x right, y down, z forward), world-to-camera, and pixels counted from the corner of the first pixel, as the
//! network's cameras are. Units are the file's own. Nothing is guessed: what a file does not say, or says twice, is an error that names it.

mod colmap;
mod given;
mod lens;
mod matching;
mod pose;
mod transforms;
mod tum;

use std::path::Path;

pub use given::{GivenCamera, GivenCameras, PictureKey};
pub use lens::{Distortion, Lens};
pub use matching::{MatchedCamera, match_cameras};
pub(crate) use matching::{common_folders, stem};

use crate::IoError;

/// Reads cameras: a folder with a COLMAP model (also one with `sparse/0` or `sparse`), one of the model's files, `transforms.json`, or a trajectory.
///
/// # Errors
/// [`IoError::BadCameras`] names the file, the line or picture, what is wrong and the cure; failures of reading.
pub fn read(path: &Path) -> Result<GivenCameras, IoError> {
    let bad = |reason: &str| IoError::BadCameras { reason: reason.to_owned(), path: path.to_owned() };
    if path.is_dir() {
        for folder in ["", "sparse/0", "sparse"] {
            if let Some(model) = colmap::Model::in_folder(&path.join(folder)) {
                return model.read();
            }
        }
        let json = path.join("transforms.json");
        return if json.is_file() {
            transforms::read(&json)
        } else {
            Err(bad("a folder of cameras has cameras.bin and images.bin (or .txt) of COLMAP, or transforms.json"))
        };
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    if let (true, Some(folder)) = (colmap::is_part(&name), path.parent()) {
        let incomplete = || bad("cameras and images of a COLMAP model lie beside each other, both .bin or both .txt");
        return colmap::Model::in_folder(folder).ok_or_else(incomplete)?.read();
    }
    match Path::new(&name).extension().and_then(|e| e.to_str()) {
        Some("json") => transforms::read(path),
        Some("txt" | "tum") => tum::read(path),
        _ => Err(bad("cameras are read from COLMAP models, transforms.json and TUM trajectories (.txt, .tum)")),
    }
}

#[cfg(test)]
mod tests;
