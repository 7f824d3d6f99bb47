//! A step on a device: the network, its objective and their gradient as one plan, and the update as another.
//!
//! What outlives a step lies in lists of all trained numbers (`groups.rs`), which the plans are bound to: weights, their two moments,
//! gradients and, where they are asked for, sums of gradients and the average of the weights. Nothing of them is read back but to save
//! them. Tensors that stay as they are, are stored as in inference and cost neither gradient nor moments.

mod plan;
mod size;
mod start;
mod state;
mod step;
mod targets;
mod update;

pub use plan::{Objective, Room, StepPlan, Takes};
pub use size::Size;
pub use start::{planned, planned_among, planned_least, ready, ready_among};
pub use step::DeviceStep;
pub use update::Optimiser;
