//! The program as a user runs it: its files, words and exit codes.

#![expect(clippy::unwrap_used, reason = "a failed helper is a failed test")]

mod bad_input;
mod bad_weights;
mod checkpoints;
mod commands;
mod common;
mod data;
mod device_lost;
mod eval;
mod film_field;
mod hand_out;
mod happy;
#[cfg(unix)]
mod interrupted;
mod known_cameras;
mod known_distance;
mod limits;
mod made;
mod masks;
mod messages;
mod motion;
mod networks;
#[expect(unreachable_pub, reason = "the harness has it as well")]
mod pytorch;
mod render;
mod scenes;
mod surroundings;
mod train;
mod windows;
