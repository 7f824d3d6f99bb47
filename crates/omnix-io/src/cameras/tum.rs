//! Trajectories of the TUM RGB-D benchmark ("File formats": `timestamp tx ty tz qx qy qz qw`, camera-to-world), with the lens in a file of
//! its own beside them.
//!
//! `intrinsics.txt` holds `fx fy cx cy`, and after these `width height` where the pictures are of another size; or the nine numbers of the
//! matrix. Pixels are counted as OpenCV does, from the centre of the first.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use super::given::{GivenCamera, GivenCameras, PictureKey, text};
use super::lens::{Distortion, Lens};
use super::pose;
use crate::IoError;

/// The file with the lens.
const LENS: &str = "intrinsics.txt";

pub(super) fn read(path: &Path) -> Result<GivenCameras, IoError> {
    let bad = |reason: String| IoError::BadCameras { reason, path: path.to_owned() };
    let beside = path.with_file_name(LENS);
    if !beside.is_file() {
        return Err(bad(format!("the lens of a trajectory is needed: put fx fy cx cy into {LENS} beside it")));
    }
    let (lens, size) = lens(&beside)?;
    let mut cameras = Vec::new();
    for (number, line) in text(path)?.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let at = |reason: &str| bad(format!("line {}: {reason}", number + 1));
        let all = numbers(line).unwrap_or_default();
        let [time, tx, ty, tz, qx, qy, qz, qw] = all[..] else {
            return Err(at("eight numbers are needed: timestamp tx ty tz qx qy qz qw"));
        };
        let q = DQuat::from_xyzw(qx, qy, qz, qw);
        if !time.is_finite() || !(0.9..=1.1).contains(&q.length()) {
            return Err(at("the time is not finite, or the quaternion's length is not 1"));
        }
        let world_to_camera =
            pose::from_camera_to_world(DMat3::from_quat(q.normalize()), DVec3::new(tx, ty, tz)).map_err(at)?;
        cameras.push(GivenCamera { picture: PictureKey::Time(time), size, lens, world_to_camera });
    }
    Ok(GivenCameras { cameras, format: "tum", path: path.to_owned() })
}

fn numbers(line: &str) -> Option<Vec<f64>> {
    line.split(|c: char| c.is_whitespace() || c == ',')
        .filter(|field| !field.is_empty())
        .map(|field| field.parse().ok())
        .collect()
}

fn lens(path: &Path) -> Result<(Lens, Option<[u32; 2]>), IoError> {
    let bad = |reason: &str| IoError::BadCameras { reason: reason.to_owned(), path: path.to_owned() };
    let text = text(path)?;
    let all: Option<Vec<f64>> = text
        .lines()
        .filter(|line| !line.trim_start().starts_with('#'))
        .map(numbers)
        .collect::<Option<Vec<_>>>()
        .map(|all| all.concat());
    let all = all.filter(|all| all.iter().all(|v| v.is_finite()));
    let (focal, [cx, cy], size) = match all.as_deref() {
        Some([fx, fy, cx, cy]) => ([*fx, *fy], [*cx, *cy], None),
        Some([fx, fy, cx, cy, w, h]) => ([*fx, *fy], [*cx, *cy], Some([*w as u32, *h as u32])),
        Some([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]) => ([*fx, *fy], [*cx, *cy], None),
        _ => {
            return Err(bad(
                "fx fy cx cy are needed, perhaps with width height, or the nine numbers of the matrix, without skew",
            ));
        }
    };
    if focal.iter().any(|f| *f <= 0.0) || size.is_some_and(|size| size.contains(&0)) {
        return Err(bad("focal lengths and sizes are above 0"));
    }
    // Pixel centres at whole numbers there, half a pixel from the corner here.
    Ok((Lens { focal, centre: Some([cx + 0.5, cy + 0.5]), distortion: Distortion::default() }, size))
}
