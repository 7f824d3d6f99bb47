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
mod network;
mod paths;
mod pose;
mod scenes;
mod sequence;
mod tapvid3d;
#[cfg(test)]
mod tests;
mod trajectories;

pub use self::depth::{DepthData, depth};
pub use self::network::{Clip, Network, Seen};
pub use self::pose::{PoseData, pose};
pub use self::scenes::{SceneData, clip_of};
pub use self::sequence::Progress;
pub use self::tapvid3d::tapvid3d;
pub use self::trajectories::{INPUTS, trajectories};
