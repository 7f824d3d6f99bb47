//! Measures whether the ground truth of a scene agrees with itself, and says what is wrong where it does not.
//!
//! * *Warp* (`warp.rs`): pixels that stand still, or images of one moment, are moved by depth and cameras into other images, where their
//!   depth is compared with the depth there. Relative errors; what lies behind a nearer surface is hidden, what lies in front of
//!   the surface is a contradiction.
//! * *Tracks* (`tracks.rs`): where paths fall in images, beside where the data set says so; paths beside depth and masks; visibility.
//! * *Faults* (`faults.rs`): if depth or tracks disagree, the cameras are changed in the ways in which data sets are known to be
//!   wrong, and a change that makes them agree is named.

mod facing;
mod faults;
mod grid;
#[cfg(test)]
mod tests;
mod text;
mod tracks;
mod warp;

use std::path::Path;

use serde::Serialize;

use crate::read::{ReadOptions, read};
use crate::rigid::Pinhole;
use crate::scene::{Pick, Scene};
use crate::{DataError, Flag, Motion, Sample};

pub use text::{lines, write_page, write_sheet};
pub use tracks::{TrackErrors, Visibility};
pub use warp::WarpErrors;

/// Median relative error of depth between views above which they do not agree.
const WARP: f64 = 0.02;
/// The same above which a cause is looked for.
const SUSPECT: f64 = 0.004;
/// Share of pixels in front of the surface that another view sees.
const IN_FRONT: f64 = 0.05;
/// Median error of paths in pixels.
const PIXELS: f64 = 1.0;
/// Share of visibility flags that contradict depth.
const CONTRADICTIONS: f64 = 0.02;
/// Largest deviation of a rotation from an orthonormal matrix.
const ROTATION: f64 = 1e-3;

/// What is known about a scene, in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Counts {
    /// Images that were looked at.
    pub images: usize,
    /// Videos of the scene.
    pub videos: usize,
    /// Images of the scene.
    pub all_images: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Share of pixels with known depth; none without depth.
    pub depth_known: Option<f64>,
    /// Smallest and largest known depth.
    pub depth_range: Option<[f64; 2]>,
    /// Share of pixels that are said to move; none without masks.
    pub moving: Option<f64>,
    /// Number of tracks; none without.
    pub tracks: Option<usize>,
    /// Share of known positions among all of dense paths or tracks.
    pub positions_known: Option<f64>,
}

/// The rotations of the cameras as matrices.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rotations {
    /// Largest entry of |R R^T - 1|.
    pub error: f64,
    /// Number of cameras whose determinant is below 0: they mirror.
    pub mirrored: usize,
}

/// Something that is wrong with a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// A short name that scripts can rely on.
    pub kind: &'static str,
    /// What it is, and what to do.
    pub text: String,
}

/// What was measured of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneReport {
    /// Its folder.
    pub path: String,
    /// Name of its data set.
    pub set: &'static str,
    /// Numbers.
    pub counts: Counts,
    /// The cameras' rotations.
    pub rotations: Rotations,
    /// Depth between views; none where no two views can be compared.
    pub warp: Option<WarpErrors>,
    /// Paths; none without.
    pub tracks: Option<TrackErrors>,
    /// Visibility beside depth; none without both.
    pub visibility: Option<Visibility>,
    /// What is wrong; nothing is a good scene.
    pub problems: Vec<Problem>,
}

/// How a scene is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CheckOptions {
    /// Images that are looked at, at most.
    pub images: usize,
    /// Bytes that they may take.
    pub most: u64,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self { images: 12, most: 4 << 30 }
    }
}

/// The images of a scene that a check looks at: some videos, and in each some images near to each other.
#[must_use]
pub fn choose(scene: &dyn Scene, most: usize) -> Vec<Pick> {
    let videos = scene.videos();
    let most = most.max(1);
    // As many images per video as videos, roughly.
    let wanted = videos.len().min((most as f64).sqrt().ceil() as usize).max(1);
    let per_video = (most / wanted).max(1);
    let mut picks = Vec::new();
    for k in 0..wanted.min(videos.len()) {
        let video = k * videos.len() / wanted;
        let frames = videos[video].frames;
        let step = (frames / per_video).clamp(1, 8);
        picks.extend((0..frames).step_by(step).take(per_video).map(|frame| Pick::plain(video, frame)));
    }
    picks.truncate(most);
    picks
}

/// Reads some images of a scene and checks them.
///
/// # Errors
/// Whatever is wrong with its files.
pub fn check_scene(scene: &dyn Scene, options: &CheckOptions) -> Result<(Sample, SceneReport), DataError> {
    let picks = choose(scene, options.images);
    let sample = read(scene, &picks, &ReadOptions { most: options.most, ..ReadOptions::default() })?;
    let mut report = check(&sample, scene.path());
    report.set = scene.set().name();
    report.counts.videos = scene.videos().len();
    report.counts.all_images = scene.videos().iter().map(|video| video.frames).sum();
    Ok((sample, report))
}

/// Checks a sample that came from `path`.
#[must_use]
pub fn check(sample: &Sample, path: &Path) -> SceneReport {
    let cameras: Vec<Pinhole> = sample.cameras().iter().map(Pinhole::new).collect();
    let rotations = rotations(&cameras);
    let pairs = warp::pairs(sample);
    let warp = warp::measure(sample, &cameras, &pairs);
    let tracks = tracks::measure(sample, &cameras);
    let visibility = tracks::visibility(sample, &cameras);
    let mut problems = Vec::new();
    if rotations.mirrored > 0 {
        let text = format!(
            "{} of {} cameras mirror: their rotations have a determinant below 0",
            rotations.mirrored,
            cameras.len()
        );
        problems.push(Problem { kind: "mirrored_rotation", text });
    }
    if rotations.error > ROTATION {
        let text =
            format!("rotations are off by {:.2e}: their rows should be of length 1 and orthogonal", rotations.error);
        problems.push(Problem { kind: "not_a_rotation", text });
    }
    let warp_off = warp.as_ref().is_some_and(|w| w.told && (w.median > WARP || w.in_front > IN_FRONT));
    let tracks_off = tracks.as_ref().is_some_and(|t| t.median > PIXELS);
    let suspect = warp.as_ref().is_some_and(|w| w.told && w.median > SUSPECT);
    if warp_off || tracks_off || suspect {
        let found = faults::find(sample, &cameras, &pairs, tracks_off);
        problems.extend(found.into_iter().map(|fault| Problem { kind: fault.kind(), text: fault.to_string() }));
    }
    if warp_off && let Some(w) = &warp {
        let text = format!(
            "depth of one view disagrees with that of another: median {:.3}, {:.0} % in front of what the other sees",
            w.median,
            100.0 * w.in_front
        );
        problems.push(Problem { kind: "warp", text });
    }
    if tracks_off && let Some(t) = &tracks {
        let text = format!("paths fall {:.1} pixels (median) from where the data set says", t.median);
        problems.push(Problem { kind: "reprojection", text });
    }
    if let Some(v) = visibility.as_ref().filter(|v| v.contradictions as f64 > CONTRADICTIONS * v.compared as f64) {
        let text = format!(
            "{} of {} visibility flags contradict depth ({} seen outside of the image, {} seen behind a surface, {} hidden by nothing)",
            v.contradictions, v.compared, v.outside, v.behind, v.hidden
        );
        problems.push(Problem { kind: "visibility", text });
    }
    if let Some(t) = tracks.as_ref().filter(|t| t.still_but_moving > 0) {
        let text = format!("{} points of pixels that are said to stand still move", t.still_but_moving);
        problems.push(Problem { kind: "moving_mask", text });
    }
    SceneReport {
        path: path.to_string_lossy().into_owned(),
        set: "",
        counts: counts(sample),
        rotations,
        warp,
        tracks,
        visibility,
        problems,
    }
}

fn rotations(cameras: &[Pinhole]) -> Rotations {
    let off = |camera: &Pinhole| {
        let r = camera.w2c.rotation;
        let product = (r * r.transpose() - glam::DMat3::IDENTITY).to_cols_array();
        product.into_iter().fold(0.0, |most: f64, v| most.max(v.abs()))
    };
    Rotations {
        error: cameras.iter().map(off).fold(0.0, f64::max),
        mirrored: cameras.iter().filter(|camera| camera.w2c.rotation.determinant() < 0.0).count(),
    }
}

fn counts(sample: &Sample) -> Counts {
    let all = (sample.count() * sample.pixels()) as f64;
    let parts = sample.parts();
    let known = parts.depth.as_ref().map(|depth| depth.iter().filter(|z| z.is_finite()));
    let range = known.clone().map(|known| {
        known.fold([f64::INFINITY, 0.0f64], |[low, high], z| [low.min(f64::from(*z)), high.max(f64::from(*z))])
    });
    let positions = match &parts.motion {
        Motion::Unknown => None,
        Motion::Dense(dense) => Some(&dense.positions),
        Motion::Tracks(tracks) => Some(&tracks.positions),
    };
    let share =
        |list: &Vec<[f32; 3]>| list.iter().filter(|p| p[0].is_finite()).count() as f64 / list.len().max(1) as f64;
    let moves = |list: &Vec<Flag>| list.iter().filter(|flag| **flag == Flag::Yes).count() as f64 / all;
    Counts {
        images: sample.count(),
        videos: 1,
        all_images: sample.count(),
        size: sample.size(),
        depth_known: known.map(|known| known.count() as f64 / all),
        depth_range: range.filter(|[_, high]| *high > 0.0),
        moving: parts.moving.as_ref().map(moves),
        tracks: match &parts.motion {
            Motion::Tracks(tracks) => Some(tracks.count),
            Motion::Unknown | Motion::Dense(_) => None,
        },
        positions_known: positions.map(share),
    }
}
