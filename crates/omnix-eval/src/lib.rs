//! The numbers of papers: predictions against truth, by the definitions of published evaluation code. No device, no network.
//!
//! * [`depth`]: video depth (Abs Rel, delta, RMSE) under one alignment per sequence.
//! * [`pose`]: camera trajectories (ATE, RPE) as the tool evo measures them; [`align`] has the similarity.
//! * [`tracks`]: 3D point tracks: TAPVid-3D, tracks in the world of the first camera, dense trajectories of all pixels.
//! * [`network`]: what a network says of samples with known depth, cameras and motion, figure by figure, beside trivial answers.
//! * [`clips`]: how a sequence is cut into clips of 16 frames.
//! * [`files`]: readers of the data sets' files and of predictions.
//! * [`kinds`]: a whole evaluation from two folders; [`run`]: one that runs a network over a data set; [`table`] and [`plot`], which say its
//!   result.
//!
//! Arithmetic is f64 and sums run in one order, so the same files give the same bits. Lengths are in metres where the truth is,
//! angles in degrees, camera axes are OpenCV's (x right, y down, z forward). What a metric leaves out is counted in its result.

pub mod align;
pub mod clips;
pub mod depth;
mod digits;
mod error;
pub mod files;
pub mod kinds;
pub mod network;
pub mod plot;
pub mod pose;
mod rigid;
pub mod run;
mod stats;
pub mod table;
pub mod tracks;

pub use error::EvalError;
pub use rigid::Rigid;
pub use stats::{Statistics, lower_median, median};
