//! Camera trajectories from files.
//!
//! TUM: text, a line for each pose, `timestamp tx ty tz qx qy qz qw`, camera-to-world; lines that begin with # are comments. Lists of
//! pictures have `timestamp file`. Sintel `.cam`: f32 tag 202021.25, f64 3x3 intrinsics, f64 3x4 world-to-camera, little endian.

use std::path::{Path, PathBuf};

use super::depth::SINTEL_TAG;
use super::folder;
use crate::pose::{Trajectory, associate_greedily};
use crate::{EvalError, Rigid};

/// Seconds within which TUM's pictures and poses belong together, every which match is used, and how many.
pub const TUM_TOLERANCE_S: f64 = 0.02;
/// Every third match is used by the benchmarks of videos.
pub const TUM_STRIDE: usize = 3;
/// And the first 90 of those.
pub const TUM_FRAMES: usize = 90;

/// A camera of Sintel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SintelCamera {
    /// Three rows, pixels.
    pub intrinsics: [[f64; 3]; 3],
    /// Three rows `[R|t]`.
    pub world_to_camera: [[f64; 4]; 3],
}

/// Reads a trajectory in TUM's format.
///
/// # Errors
/// [`EvalError::Read`]; [`EvalError::Format`] names the line that is no pose.
pub fn read_tum(path: &Path) -> Result<Trajectory, EvalError> {
    let mut trajectory = Trajectory::default();
    for (number, line) in lines(&folder::text(path, "TUM trajectory")?) {
        let wrong = |reason: &str| EvalError::format("TUM trajectory", format!("line {number} {reason}"), path);
        let values: Option<Vec<f64>> = line.replace(',', " ").split_whitespace().map(|v| v.parse().ok()).collect();
        let Some([stamp, x, y, z, quaternion @ ..]) = values.as_deref() else {
            return Err(wrong("is not `timestamp tx ty tz qx qy qz qw`"));
        };
        let quaternion = <[f64; 4]>::try_from(quaternion).map_err(|_| wrong("has not 8 numbers"))?;
        let pose = Rigid::from_quaternion([*x, *y, *z], quaternion).filter(|_| stamp.is_finite());
        trajectory.stamps.push(*stamp);
        trajectory.poses.push(pose.ok_or_else(|| wrong("has a NaN, an infinity or a quaternion of zeros"))?);
    }
    Ok(trajectory)
}

/// Reads a list of pictures in TUM's format: times and names.
///
/// # Errors
/// As [`read_tum`].
pub fn read_tum_list(path: &Path) -> Result<Vec<(f64, String)>, EvalError> {
    let text = folder::text(path, "list of pictures")?;
    let entry = |(number, line): (usize, &str)| {
        let (stamp, file) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let stamp = stamp.parse().ok().filter(|stamp: &f64| stamp.is_finite() && !file.trim().is_empty());
        let reason = format!("line {number} is not `timestamp file`");
        Ok((stamp.ok_or_else(|| EvalError::format("list of pictures", reason, path))?, file.trim().to_owned()))
    };
    lines(&text).map(entry).collect()
}

/// Lines with something on them but comments, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let all = text.strip_prefix('\u{feff}').unwrap_or(text).lines().map(str::trim).enumerate();
    all.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).map(|(number, line)| (number + 1, line))
}

/// A sequence of TUM as benchmarks of videos use it: `rgb.txt` matched with `groundtruth.txt`, every third match, the first 90. Times are
/// the pictures'.
///
/// # Errors
/// As the two files have them; [`EvalError::NoOverlap`] if no times match.
pub fn read_tum_sequence(folder: &Path) -> Result<Trajectory, EvalError> {
    Ok(read_tum_pictures(folder)?.0)
}

/// As [`read_tum_sequence`], with the picture of each pose.
///
/// # Errors
/// As [`read_tum_sequence`].
pub fn read_tum_pictures(folder: &Path) -> Result<(Trajectory, Vec<PathBuf>), EvalError> {
    let pictures = read_tum_list(&folder.join("rgb.txt"))?;
    let truth = read_tum(&folder.join("groundtruth.txt"))?;
    let stamps: Vec<f64> = pictures.iter().map(|(stamp, _)| *stamp).collect();
    let pairs = associate_greedily(&stamps, &truth.stamps, TUM_TOLERANCE_S);
    if pairs.is_empty() {
        let span = |times: &[f64]| {
            [
                times.iter().copied().fold(f64::INFINITY, f64::min),
                times.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ]
        };
        let (predicted, truth) = (span(&stamps), span(&truth.stamps));
        return Err(EvalError::NoOverlap { predicted, truth, tolerance: TUM_TOLERANCE_S });
    }
    let kept: Vec<(usize, usize)> = pairs.into_iter().step_by(TUM_STRIDE).take(TUM_FRAMES).collect();
    let files = kept.iter().map(|&(i, _)| folder.join(&pictures[i].1)).collect();
    let trajectory = Trajectory {
        stamps: kept.iter().map(|&(i, _)| stamps[i]).collect(),
        poses: kept.iter().map(|&(_, k)| truth.poses[k]).collect(),
    };
    Ok((trajectory, files))
}

/// Reads a camera of Sintel.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`].
pub fn read_sintel(path: &Path) -> Result<SintelCamera, EvalError> {
    let bytes = folder::bytes(path)?;
    let wrong = |reason: &str| EvalError::format("Sintel camera", reason, path);
    let (tag, rest) = bytes.split_first_chunk::<4>().ok_or_else(|| wrong("it is empty"))?;
    let (numbers, left) = rest.as_chunks::<8>();
    if f32::from_le_bytes(*tag) != SINTEL_TAG || numbers.len() != 21 || !left.is_empty() {
        return Err(wrong("it is not a tag, 9 numbers of intrinsics and 12 of the pose"));
    }
    let value = |k: usize| f64::from_le_bytes(numbers[k]);
    let camera = SintelCamera {
        intrinsics: std::array::from_fn(|i| std::array::from_fn(|j| value(3 * i + j))),
        world_to_camera: std::array::from_fn(|i| std::array::from_fn(|j| value(9 + 4 * i + j))),
    };
    if (0..21).all(|k| value(k).is_finite()) { Ok(camera) } else { Err(wrong("a number of it is NaN or infinite")) }
}

/// The trajectory of a sequence of Sintel: its `.cam` files in order of their names, positions relative to their mean, times 1, 2, 3...
///
/// # Errors
/// As [`read_sintel`]; [`EvalError::NoSequences`] for a folder without such files.
pub fn read_sintel_sequence(folder: &Path) -> Result<Trajectory, EvalError> {
    let files = folder::files(folder, "cam")?;
    if files.is_empty() {
        return Err(EvalError::NoSequences {
            layout: "a folder with frame_0001.cam and so on",
            path: folder.to_owned(),
        });
    }
    let mut trajectory = Trajectory::default();
    for (frame, path) in files.iter().enumerate() {
        let pose = Rigid::from_rows(&read_sintel(path)?.world_to_camera);
        let wrong = || EvalError::format("Sintel camera", "its pose is not finite", path);
        trajectory.poses.push(pose.ok_or_else(wrong)?.inverse());
        trajectory.stamps.push(frame as f64 + 1.0);
    }
    let n = trajectory.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|k| trajectory.positions().iter().map(|p| p[k]).sum::<f64>() / n);
    for pose in &mut trajectory.poses {
        let position = pose.translation();
        *pose = pose.with_translation(std::array::from_fn(|k| position[k] - mean[k]));
    }
    Ok(trajectory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_are_no_poses_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_tum(&path)
        };
        let found = read("\u{feff}# comment\n\n1.5 1 2 3 0 0 0 2\r\n 2.5,1,2,3,0,0,0,1\n").unwrap();
        assert_eq!((found.stamps.as_slice(), found.poses[0]), ([1.5, 2.5].as_slice(), found.poses[1]));
        for bad in ["1 2 3", "1 1 2 3 0 0 0 x", "1 1 2 3 0 0 0 0", "1 1 2 3 0 0 0 1 9", "1 nan 2 3 0 0 0 1"] {
            let error = read(&format!("# one\n{bad}\n")).unwrap_err().to_string();
            assert!(error.contains("line 2"), "{error}");
        }
        std::fs::write(&path, "1.0\n").unwrap();
        assert!(read_tum_list(&path).unwrap_err().to_string().contains("line 1"));
    }

    #[test]
    fn cut_cameras_and_empty_folders_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(read_sintel_sequence(dir.path()), Err(EvalError::NoSequences { .. })));
        std::fs::write(dir.path().join("frame_0001.cam"), SINTEL_TAG.to_le_bytes()).unwrap();
        assert!(matches!(read_sintel_sequence(dir.path()), Err(EvalError::Format { .. })));
    }
}
