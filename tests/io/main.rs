//! omnix-io against goldens of the references, and its files read back by other code.

mod bad_input;
mod common;
mod folders;
mod outputs;
mod outputs_bad;
mod pictures;
mod preprocess;
mod video;
mod video_damage;
mod video_truth;
