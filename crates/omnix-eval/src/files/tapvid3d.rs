//! Clips of TAPVid-3D and predictions for them, NPZ archives (`eval.md` section 3).
//!
//! Truth: `images_jpeg_bytes` `[T]` (fixed or pickled byte strings), `queries_xyt` `[N,3]` (x, y in pixels, frame), `tracks_XYZ` `[T,N,3]`
//! metres in the camera of each time, `visibility` `[T,N]`, `fx_fy_cx_cy` `[4]` in pixels of the pictures, `extrinsics_w2c` `[T,4,4]` where
//! the camera moves. Prediction: `tracks_XYZ` and `visibility`.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, ImageReader};

use super::npz::Archive;
use crate::tracks::METRIC_RESOLUTION;
use crate::{EvalError, Rigid};

const WHAT: &str = "TAPVid-3D clip";

/// A clip's truth.
#[derive(Debug, Clone)]
pub struct ClipTruth {
    /// T.
    pub frames: usize,
    /// N.
    pub tracks: usize,
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// The first picture, JPEG.
    pub first_picture: Vec<u8>,
    /// x, y in pixels, and the frame, of each query.
    pub queries: Vec<[f64; 3]>,
    /// `[T][N]`, camera of each time.
    pub points: Vec<[f64; 3]>,
    /// `[T][N]`.
    pub visible: Vec<bool>,
    /// fx, fy, cx, cy in pixels of the pictures.
    pub intrinsics: [f64; 4],
    /// World-to-camera of each time; none where the camera stands still.
    pub extrinsics: Option<Vec<Rigid>>,
}

/// A clip's prediction.
#[derive(Debug, Clone)]
pub struct ClipPrediction {
    /// `[T][N]`, camera of each time.
    pub points: Vec<[f64; 3]>,
    /// `[T][N]`.
    pub visible: Vec<bool>,
}

/// Reads a clip's truth.
///
/// # Errors
/// As [`Archive::array`]; [`EvalError::Shape`], [`EvalError::Format`] for arrays that do not belong together.
pub fn read_truth(path: &Path) -> Result<ClipTruth, EvalError> {
    let mut archive = Archive::open(path)?;
    let points = archive.array("tracks_XYZ")?;
    points.expect(&[None, None, Some(3)], "[T, N, 3]")?;
    let (frames, tracks) = (points.shape()[0], points.shape()[1]);
    let visible = archive.array("visibility")?;
    visible.expect(&[Some(frames), Some(tracks)], &format!("[T, N] = [{frames}, {tracks}]"))?;
    let queries = archive.array("queries_xyt")?;
    queries.expect(&[Some(tracks), Some(3)], &format!("[N, 3] = [{tracks}, 3]"))?;
    let intrinsics = archive.array("fx_fy_cx_cy")?;
    intrinsics.expect(&[Some(4)], "[4]")?;
    let intrinsics: Vec<f64> = intrinsics.f64s()?;
    let extrinsics = if archive.has("extrinsics_w2c") {
        let array = archive.array("extrinsics_w2c")?;
        array.expect(&[Some(frames), Some(4), Some(4)], &format!("[T, 4, 4] = [{frames}, 4, 4]"))?;
        Some(poses(&array.f64s()?, path)?)
    } else {
        None
    };
    let first_picture = archive.array("images_jpeg_bytes")?.byte_strings()?.into_iter().next();
    let first_picture = first_picture.ok_or_else(|| EvalError::format(WHAT, "it has no picture", path))?;
    let dimensions = ImageReader::with_format(Cursor::new(&first_picture), ImageFormat::Jpeg).into_dimensions();
    let (width, height) = dimensions.map_err(|e| EvalError::format(WHAT, format!("its first picture: {e}"), path))?;
    Ok(ClipTruth {
        frames,
        tracks,
        size: [width, height],
        first_picture,
        queries: queries.points()?,
        points: points.points()?,
        visible: visible.bools()?,
        intrinsics: std::array::from_fn(|k| intrinsics[k]),
        extrinsics,
    })
}

/// The pictures of a clip, JPEG, in order.
///
/// # Errors
/// As [`Archive::array`].
pub fn read_pictures(path: &Path) -> Result<Vec<Vec<u8>>, EvalError> {
    Archive::open(path)?.array("images_jpeg_bytes")?.byte_strings()
}

fn poses(numbers: &[f64], path: &Path) -> Result<Vec<Rigid>, EvalError> {
    let one = |m: &[f64]| Rigid::from_rows(&std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j])));
    let found: Option<Vec<_>> = numbers.chunks_exact(16).map(one).collect();
    found.ok_or_else(|| EvalError::format(WHAT, "a pose of extrinsics_w2c is NaN or infinite", path))
}

impl ClipTruth {
    /// fx and fy at the metric resolution: times 256 / the shorter side.
    #[must_use]
    pub fn focal(&self) -> [f64; 2] {
        let factor = METRIC_RESOLUTION / f64::from(self.size[0].min(self.size[1]).max(1));
        [self.intrinsics[0] * factor, self.intrinsics[1] * factor]
    }

    /// The frame of each query, rounded half to even as numpy does; a frame outside the clip is an error.
    ///
    /// # Errors
    /// [`EvalError::Parameter`].
    pub fn query_frames(&self) -> Result<Vec<usize>, EvalError> {
        let frame = |query: &[f64; 3]| {
            let frame = query[2].round_ties_even();
            let inside = frame >= 0.0 && frame < self.frames as f64;
            let expected = "a track is asked for in a frame of its clip";
            let value = query[2].to_string();
            if inside { Ok(frame as usize) } else { Err(EvalError::Parameter { name: "query frame", value, expected }) }
        };
        self.queries.iter().map(frame).collect()
    }

    /// The pixel positions of the points, `[T][N]`, by the pinhole model.
    #[must_use]
    pub fn pixels(&self) -> Vec<[f64; 2]> {
        let [fx, fy, cx, cy] = self.intrinsics;
        self.points.iter().map(|&[x, y, z]| [fx * x / z + cx, fy * y / z + cy]).collect()
    }
}

/// Reads a prediction for a clip of `frames` frames and `tracks` tracks.
///
/// # Errors
/// As [`Archive::array`]; [`EvalError::Shape`] for other sizes than the truth's.
pub fn read_prediction(path: &Path, frames: usize, tracks: usize) -> Result<ClipPrediction, EvalError> {
    let mut archive = Archive::open(path)?;
    let points = archive.array("tracks_XYZ")?;
    points.expect(&[Some(frames), Some(tracks), Some(3)], &format!("the truth's [{frames}, {tracks}, 3]"))?;
    let visible = archive.array("visibility")?;
    visible.expect(&[Some(frames), Some(tracks)], &format!("the truth's [{frames}, {tracks}]"))?;
    Ok(ClipPrediction { points: points.points()?, visible: visible.bools()? })
}
