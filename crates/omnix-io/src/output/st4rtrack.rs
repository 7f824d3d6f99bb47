//! `st4rtrack`: `exports/st4rtrack/`, the folder that St4RTrack's viewer reads (`visualizer_st4rtrack.py --traj_path FOLDER`).
//!
//! The layout is what the published viewer loads and what its `infer.py` saves; T images, i = 0..T−1 without leading zeros:
//! * `pts3d1_p{i}.npy` f32 [H,W,6]: "tracking points", every pixel of image 0 where it is at time i: x, y, z, r, g, b
//! * `conf1_p{i}.npy` f32 [H,W]: confidence of these
//! * `pts3d2_p{i}.npy` f32 [H,W,6]: "reconstruction", every pixel of image i at its own time i
//! * `conf2_p{i}.npy` f32 [H,W]
//!
//! Colours are 0..1. The viewer stacks each kind over i, so all images have one size; it needs both kinds. It subtracts the mean of
//! all points and drops those whose confidence is the lowest: a point that is not finite is written as zeros with confidence 0,
//! since one NaN would hide the scene. It halves precision to f16 on loading, which is its own doing. Positions are in the world frame
//! (OpenCV axes, as St4RTrack's: first camera).

use std::path::{Path, PathBuf};

use super::{
    format::{Each, FileKind, Format, ImageWriter, Points},
    motion::{MotionView, SourceMotion},
    npy::{Array, write_npy},
};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "st4rtrack",
    needs_cameras: true,
    needs_motion: true,
    files: &[
        kind(
            "exports/st4rtrack/pts3d1_p{n}.npy",
            "f32 [H,W,6], x y z r g b: image 0's pixels at time n",
            Points::Network,
        ),
        kind("exports/st4rtrack/conf1_p{n}.npy", "f32 [H,W]: confidence of pts3d1", Points::None),
        kind(
            "exports/st4rtrack/pts3d2_p{n}.npy",
            "f32 [H,W,6], x y z r g b: image n's pixels at its own time",
            Points::Network,
        ),
        kind("exports/st4rtrack/conf2_p{n}.npy", "f32 [H,W]: confidence of pts3d2", Points::None),
    ],
    disk: |size| size.all().saturating_mul(2 * 28),
    images: Some(ImageWriter { write, wants_trajectory: |image| image == 0 }),
    ..Format::NONE
};

const fn kind(name: &'static str, contains: &'static str, points: Points) -> FileKind {
    FileKind { name, each: Each::Image, contains, points }
}

/// Writes image i's reconstruction, and of image 0 its pixels at all times.
fn write(dir: &Path, views: &[MotionView], image: &SourceMotion<'_>) -> Result<Vec<PathBuf>, IoError> {
    image.check(views, FORMAT.name)?;
    image.need_all_pixels(views, FORMAT.name)?;
    let folder = dir.join("exports/st4rtrack");
    let view = &views[image.index];
    let mut written = pair(&folder, 2, image.index, view, image.points, image.confidence)?.to_vec();
    if image.index == 0 {
        let trajectory = image.need_trajectory(FORMAT.name)?;
        for (time, points) in trajectory.chunks_exact(image.points.len()).enumerate() {
            written.extend(pair(&folder, 1, time, view, points, image.confidence)?);
        }
    }
    Ok(written)
}

/// Writes points and confidences under the number `head` of St4RTrack's two.
fn pair(
    folder: &Path,
    head: u32,
    time: usize,
    view: &MotionView,
    points: &[f32],
    confidence: &[f32],
) -> Result<[PathBuf; 2], IoError> {
    let (w, h) = (view.picture.width as usize, view.picture.height as usize);
    let finite: Vec<bool> = points.chunks_exact(3).map(|p| p.iter().all(|v| v.is_finite())).collect();
    let coloured =
        points.chunks_exact(3).zip(view.picture.data.chunks_exact(3)).zip(&finite).flat_map(|((p, c), &finite)| {
            let p = if finite { [p[0], p[1], p[2]] } else { [0.0; 3] };
            [p[0], p[1], p[2], f32::from(c[0]) / 255.0, f32::from(c[1]) / 255.0, f32::from(c[2]) / 255.0]
        });
    let trusted = confidence.iter().zip(&finite).map(|(&c, &ok)| if ok && c.is_finite() { c } else { 0.0 });
    Ok([
        write_npy(folder.join(format!("pts3d{head}_p{time}.npy")), &Array::f32("", vec![h, w, 6], coloured))?,
        write_npy(folder.join(format!("conf{head}_p{time}.npy")), &Array::f32("", vec![h, w], trusted))?,
    ])
}
