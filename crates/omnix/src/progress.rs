//! Progress reports of long work, and how to stop it.

use std::ops::ControlFlow;

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Reading, packing and uploading weights that stay while their stage runs; validating those that do not.
    Weights,
    /// The network over all images.
    Backbone,
    /// Depth, image by image.
    Head,
    /// The trajectory module over all images.
    Motion,
    /// Where each pixel samples the field, image by image.
    Sampling,
}

/// A step of long work: `done` of `total` units of its phase (bytes or operations).
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What is being done.
    pub phase: Phase,
    /// Units done.
    pub done: u64,
    /// Units in all.
    pub total: u64,
}

/// A listener that ignores every report and never stops the run.
pub fn quiet() -> impl FnMut(Progress) -> ControlFlow<()> {
    |_| ControlFlow::Continue(())
}
