//! Graphs on the device: fusion, chains in chunks, memory, profile.

mod algorithm;
mod chunks;
mod compile;
mod fixed;
mod fusion;
mod gradients;
mod memory;
mod motion;
mod operations;
mod recompute;
mod stream;
mod support;
mod training;
mod upload;
