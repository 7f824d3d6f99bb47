//! Where benchmarks keep the picture of each frame of their truth.
//!
//! | set | truth | picture |
//! |---|---|---|
//! | KITTI | `DRIVE/proj_depth/groundtruth/image_02/N.png` | `DRIVE/image_02/data/N.png` or `.jpg` |
//! | KITTI, gathered | `groundtruth_depth_gathered/DRIVE/N.png` | `image_gathered/DRIVE/N.png` or `.jpg` |
//! | Sintel, depth | `depth/NAME/frame_0001.dpt` | `final/NAME/frame_0001.png` |
//! | Sintel, cameras | `camdata_left/NAME/frame_0001.cam` | `final/NAME/frame_0001.png` |
//! | Bonn | `NAME/depth_110` | `NAME/rgb_110`, in the same order |
//! | TUM | `NAME/groundtruth.txt` | what `NAME/rgb.txt` lists |

use std::path::{Path, PathBuf};

use crate::EvalError;
use crate::files::camera::{read_sintel_sequence, read_tum_pictures};
use crate::files::folder;
use crate::kinds::depth::DepthSet;
use crate::kinds::pose::{self, PoseSet};
use crate::pose::Trajectory;

/// A sequence of depth: the file of the truth and the picture of each frame.
#[derive(Debug)]
pub struct DepthSequence {
    /// Its name.
    pub name: String,
    /// Truth and picture of each frame, or why they cannot be told.
    pub frames: Result<Vec<(PathBuf, PathBuf)>, EvalError>,
}

/// The sequences of a benchmark of depth.
///
/// # Errors
/// [`EvalError::NoSequences`] for a folder without truth, [`EvalError::Parameter`] for a set without pictures.
pub fn depth_sequences(data: &Path, set: DepthSet) -> Result<Vec<DepthSequence>, EvalError> {
    let gathered = data.join("groundtruth_depth_gathered");
    let truth = match set {
        DepthSet::Kitti if gathered.is_dir() => gathered.clone(),
        DepthSet::Sintel if data.join("depth").is_dir() => data.join("depth"),
        _ => data.to_owned(),
    };
    let sequences = set.files(&truth)?;
    let of = |(name, files): (String, Vec<PathBuf>)| {
        let frames = match set {
            DepthSet::Kitti if truth == gathered => by_name(&files, &data.join("image_gathered").join(&name)),
            DepthSet::Kitti => by_name(&files, &drive(&files).unwrap_or(data.join(&name)).join("image_02/data")),
            DepthSet::Sintel => by_name(&files, &data.join("final").join(&name)),
            DepthSet::Bonn | DepthSet::Plain => in_order(&files),
        };
        DepthSequence { name, frames }
    };
    Ok(sequences.into_iter().map(of).collect())
}

/// The true trajectory of a sequence and the picture of each of its poses.
#[derive(Debug)]
pub struct PoseSequence {
    /// Its name.
    pub name: String,
    /// Trajectory and pictures, or why they cannot be told.
    pub frames: Result<(Trajectory, Vec<PathBuf>), EvalError>,
}

/// The sequences of a benchmark of cameras.
///
/// # Errors
/// As [`depth_sequences`].
pub fn pose_sequences(data: &Path, set: PoseSet) -> Result<Vec<PoseSequence>, EvalError> {
    let cameras = data.join("camdata_left");
    let truth = if set == PoseSet::Sintel && cameras.is_dir() { cameras } else { data.to_owned() };
    if set == PoseSet::Plain {
        let expected = "give sintel or tum, whose pictures can be found";
        return Err(EvalError::Parameter { name: "set", value: "plain".into(), expected });
    }
    let of = |(name, place): (String, PathBuf)| {
        let frames = if set == PoseSet::Sintel {
            read_sintel_sequence(&place).and_then(|trajectory| {
                let files = folder::files(&place, "cam")?;
                let pairs = by_name(&files, &data.join("final").join(&name))?;
                Ok((trajectory, pairs.into_iter().map(|(_, picture)| picture).collect()))
            })
        } else {
            read_tum_pictures(&place)
        };
        PoseSequence { name, frames }
    };
    Ok(pose::sequences(&truth, set)?.into_iter().map(of).collect())
}

/// The folder of a drive, above its `proj_depth/groundtruth/image_02`.
fn drive(files: &[PathBuf]) -> Option<PathBuf> {
    let maps = files.first()?.parent()?;
    maps.ends_with("proj_depth/groundtruth/image_02").then(|| maps.ancestors().nth(3).map(Path::to_owned))?
}

/// The pictures of a folder.
fn pictures(dir: &Path) -> Result<Vec<PathBuf>, EvalError> {
    let mut found = folder::files(dir, "png")?;
    found.extend(folder::files(dir, "jpg")?);
    found.sort();
    Ok(found)
}

/// Each file with the picture of its name.
fn by_name(files: &[PathBuf], dir: &Path) -> Result<Vec<(PathBuf, PathBuf)>, EvalError> {
    let pictures = pictures(dir)?;
    let pair = |file: &PathBuf| {
        let name = folder::stem(file);
        let picture = pictures.iter().find(|picture| folder::stem(picture) == name);
        let missing = || {
            let reason = format!("there is no picture {name}.png or .jpg, of which the truth is");
            EvalError::format("folder of pictures", reason, dir)
        };
        Ok((file.clone(), picture.ok_or_else(missing)?.clone()))
    };
    files.iter().map(pair).collect()
}

/// Each file of `depth_110` with the picture of the same place in `rgb_110` (or of `depth` and `rgb`).
fn in_order(files: &[PathBuf]) -> Result<Vec<(PathBuf, PathBuf)>, EvalError> {
    let dir = files.first().and_then(|file| file.parent()).unwrap_or(Path::new("."));
    let beside = dir.with_file_name(folder::name(dir).replacen("depth", "rgb", 1));
    let pictures = pictures(&beside)?;
    if pictures.len() != files.len() {
        let reason = format!("it has {} pictures for {} depth maps", pictures.len(), files.len());
        return Err(EvalError::format("folder of pictures", reason, beside));
    }
    Ok(files.iter().cloned().zip(pictures).collect())
}
