//! Trajectories of pixels as omnix writes them with `--export tracks`: `NNNNNN.npz` for each source image.
//!
//! `trajectory` `[T,H,W,3]` of all pixels or `[T,N,3]` with `pixel` `[N,2]` (column, row); positions in a world that all images share;
//! `extrinsics` `[T,3,4]` world-to-camera, `intrinsics` `[T,3,3]` in pixels; `moving`, a flag for each pixel, where it is known. Truth in the
//! same layout has all pixels, and NaN where a position is unknown.

use std::path::{Path, PathBuf};

use super::folder;
use super::npz::Archive;
use crate::{EvalError, Rigid};

const WHAT: &str = "archive of tracks";

/// The paths of the pixels of a source image.
#[derive(Debug, Clone)]
pub struct SourceTracks {
    /// T.
    pub times: usize,
    /// Which pixels.
    pub pixels: PixelSet,
    /// `[T][pixel]` in the world of `extrinsics`.
    pub points: Vec<[f64; 3]>,
    /// Whether each pixel moves; none where the file does not say.
    pub moving: Option<Vec<bool>>,
    /// World-to-camera of each image.
    pub extrinsics: Vec<Rigid>,
    /// fx and fy of each image, pixels.
    pub focal: Vec<[f64; 2]>,
}

/// Which pixels of a source image have paths.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PixelSet {
    /// All of a picture of this width and height, row by row.
    All([usize; 2]),
    /// These: column, row.
    List(Vec<[usize; 2]>),
}

impl SourceTracks {
    /// How many pixels have paths.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.pixels {
            PixelSet::All([width, height]) => width * height,
            PixelSet::List(list) => list.len(),
        }
    }
}

/// The archives of a scene, in order of its images: those of `DIR/exports/tracks`, or of `DIR` itself. Empty if there are none.
///
/// # Errors
/// [`EvalError::Read`] if the folder cannot be listed.
pub fn archives(scene: &Path) -> Result<Vec<PathBuf>, EvalError> {
    let inner = scene.join("exports/tracks");
    let dir = if inner.is_dir() { inner } else { scene.to_owned() };
    let numbered =
        |path: &PathBuf| !folder::stem(path).is_empty() && folder::stem(path).bytes().all(|b| b.is_ascii_digit());
    Ok(folder::files(&dir, "npz")?.into_iter().filter(numbered).collect())
}

/// The index of the source image of an archive: its name.
///
/// # Errors
/// [`EvalError::Format`] for another name than a number.
pub fn source_index(path: &Path) -> Result<usize, EvalError> {
    folder::stem(path).parse().map_err(|_| EvalError::format(WHAT, "its name is not the number of its image", path))
}

/// Reads the archive of a source image.
///
/// # Errors
/// As [`Archive::array`]; [`EvalError::Shape`] and [`EvalError::Format`] for arrays that do not belong together.
pub fn read(path: &Path) -> Result<SourceTracks, EvalError> {
    let mut archive = Archive::open(path)?;
    let trajectory = archive.array("trajectory")?;
    let (times, pixels) = if archive.has("pixel") {
        trajectory.expect(&[None, None, Some(3)], "[T, N, 3]")?;
        let count = trajectory.shape()[1];
        let list = archive.array("pixel")?;
        list.expect(&[Some(count), Some(2)], &format!("[N, 2] = [{count}, 2]"))?;
        let whole = |v: f64| (v >= 0.0 && v.fract() == 0.0 && v < 1e9).then_some(v as usize);
        let pixels =
            list.f64s()?.as_chunks::<2>().0.iter().map(|&[x, y]| Some([whole(x)?, whole(y)?])).collect::<Option<_>>();
        let pixels = pixels.ok_or_else(|| EvalError::format(WHAT, "a pixel is no column and row", path))?;
        (trajectory.shape()[0], PixelSet::List(pixels))
    } else {
        trajectory.expect(&[None, None, None, Some(3)], "[T, H, W, 3]")?;
        (trajectory.shape()[0], PixelSet::All([trajectory.shape()[2], trajectory.shape()[1]]))
    };
    let count = trajectory.shape()[1..trajectory.shape().len() - 1].iter().product::<usize>();
    let moving = if archive.has("moving") {
        let array = archive.array("moving")?;
        let flags = array.bools()?;
        if flags.len() != count {
            let (expected, found) = (format!("one for each of {count} pixels"), array.shape().to_vec());
            return Err(EvalError::Shape { name: "moving".into(), expected, found, path: path.to_owned() });
        }
        Some(flags)
    } else {
        None
    };
    let extrinsics = archive.array("extrinsics")?;
    extrinsics.expect(&[Some(times), Some(3), Some(4)], &format!("[T, 3, 4] = [{times}, 3, 4]"))?;
    let pose = |m: &[f64; 12]| Rigid::from_rows(&std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j])));
    let poses: Option<Vec<Rigid>> = extrinsics.f64s()?.as_chunks::<12>().0.iter().map(pose).collect();
    let intrinsics = archive.array("intrinsics")?;
    intrinsics.expect(&[Some(times), Some(3), Some(3)], &format!("[T, 3, 3] = [{times}, 3, 3]"))?;
    Ok(SourceTracks {
        times,
        pixels,
        points: trajectory.points()?,
        moving,
        extrinsics: poses.ok_or_else(|| EvalError::format(WHAT, "a pose is NaN or infinite", path))?,
        focal: intrinsics.f64s()?.as_chunks::<9>().0.iter().map(|k| [k[0], k[4]]).collect(),
    })
}
