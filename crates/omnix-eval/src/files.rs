//! Readers of the files that data sets and predictions come in. Files are not trusted: whatever the bytes, reading gives an error and
//! neither panics nor takes memory that the file's length does not justify.
//!
//! * [`npy`], [`npz`]: numpy's arrays, also big-endian ones and byte strings; [`pickle`] for those saved as objects.
//! * [`depth`]: depth maps: KITTI's and TUM's 16-bit PNG, Sintel's `.dpt`, arrays, and a run's own.
//! * [`camera`]: trajectories in TUM's text format, Sintel's `.cam`.
//! * [`tapvid3d`]: clips of TAPVid-3D and predictions for them.
//! * [`tracks`]: trajectories of pixels, as omnix writes them.

pub mod camera;
pub mod depth;
pub(crate) mod folder;
pub mod npy;
pub mod npz;
pub mod pickle;
pub mod tapvid3d;
pub mod tracks;
