//! Evaluations that run a network over a data set: sequences are cut into clips, the network sees one clip at a time, and what it says is
//! scored as predictions from files are ([`crate::kinds`]).
//!
//! | kind | data | a sequence |
//! |---|---|---|
//! | [`depth()`] | KITTI, Sintel, Bonn ([`benchmarks`]), or scenes with depth | a drive or film; a video of a scene |
//! | [`pose()`] | Sintel, TUM, or scenes | the same |
//! | [`trajectories()`] | scenes with paths | a video of a scene, and where asked for pairs of videos, and photographs with a video |
//! | [`tapvid3d()`] | TAPVid-3D | an archive |
//!
//! Scenes are those of any data set that `omnix-data` reads. Their pictures, depth and cameras are fitted to the network's size together;
//! the truth of benchmarks keeps its own size. A network's clips share no scale and no world: each is aligned by itself.

pub mod benchmarks;
mod clip;
mod depth;
mod paths;
mod pose;
mod scenes;
mod tapvid3d;
#[cfg(test)]
mod tests;
mod trajectories;

use omnix_geometry::Camera;
use omnix_io::Picture;

use crate::EvalError;
use crate::clips::ClipRule;

pub use self::depth::{DepthData, depth};
pub use self::pose::{PoseData, pose};
pub use self::scenes::{SceneData, clip_of};
pub use self::tapvid3d::tapvid3d;
pub use self::trajectories::{INPUTS, trajectories};

/// T pictures of one size, which the network sees together.
#[derive(Debug, Clone)]
pub struct Clip {
    /// Width and height.
    pub size: [u32; 2],
    /// `[T]`, of that size.
    pub pictures: Vec<Picture>,
    /// `[T]` (video, frame), as the network is told.
    pub times: Vec<(u32, u32)>,
}

/// What a network says of a clip of T pictures of H x W pixels.
#[derive(Debug, Clone)]
pub struct Seen {
    /// `[T][H][W]` z-depth.
    pub depth: Vec<f32>,
    /// `[T]`, world-to-camera, in the unit of depth; intrinsics in pixels of the clip. None of a network that makes no cameras.
    pub cameras: Vec<Camera>,
}

/// A network, as evaluations see it. Whatever keeps it from running is an [`EvalError::Run`], and ends the evaluation.
pub trait Network {
    /// Its name, for tables.
    fn name(&self) -> String;

    /// The size at which it takes pictures of this width and height: multiples of 14.
    fn size(&self, picture: [u32; 2]) -> [u32; 2];

    /// Whether it says where points go.
    fn has_paths(&self) -> bool;

    /// Runs over a clip.
    ///
    /// # Errors
    /// [`EvalError::Run`].
    fn see(&mut self, clip: &Clip) -> Result<Seen, EvalError>;

    /// Where the points of pixels (column, row; none for all, row by row) of an image of the clip seen last are at the times of the clip:
    /// `[T][pixel]`, in the world of the cameras. Asked of networks with paths alone.
    ///
    /// # Errors
    /// [`EvalError::Run`].
    fn paths(&mut self, image: usize, pixels: Option<&[[u32; 2]]>) -> Result<Vec<[f32; 3]>, EvalError>;
}

/// Told how many sequences are done, and of how many.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// The clips of a sequence, at least one.
fn clips(rule: ClipRule, frames: usize) -> Result<Vec<Vec<usize>>, EvalError> {
    let clips = rule.cut(frames)?.clips;
    if clips.is_empty() {
        let reason = format!("its {frames} frames fill no clip ({})", rule.name());
        return Err(EvalError::Nothing { reason });
    }
    Ok(clips)
}

/// At most `most` of `count`, evenly spread from the first on.
fn spread(count: usize, most: Option<usize>) -> impl Iterator<Item = usize> {
    let kept = count.min(most.unwrap_or(count));
    (0..kept).map(move |k| k * count / kept)
}

/// What a report says where not all sequences were evaluated.
fn chosen(evaluated: usize, count: usize) -> Option<String> {
    (evaluated < count)
        .then(|| format!("{evaluated} of {count} sequences were run, evenly spread; the others were not looked at"))
}

/// The network of a report, and how it saw the pictures.
fn network_note(name: &str) -> String {
    format!("predictions: the network {name}, run over one clip at a time")
}
