//! Training: the objective, and everything on the host's side from a configuration to checkpoints.
//!
//! ```text
//! config.toml -> Recipe -> Session (folder, checkpoint) -> start values -> Step (the device) -> run -> OUT
//! ```
//!
//! [`loss`] is the objective: each term is recorded into a graph; a configuration chooses between the forms that the release and the
//! paper use. [`run()`] drives whatever implements [`Step`]. What it writes is described in [`checkpoint`] and [`report`].

pub mod checkpoint;
pub mod config;
pub mod device;
mod ended;
mod error;
pub mod folder;
pub mod groups;
pub mod init;
mod interface;
mod loader;
pub mod loss;
mod mixture;
mod objective;
pub mod peers;
mod random;
mod read_config;
pub mod report;
mod run;
pub mod scenes;
pub mod schedule;
mod session;
pub mod shapes;
mod source;
mod swap;

pub use error::{StepError, TrainError};
pub use interface::{Judged, LossValues, Part, Step, Update};
pub use loader::Loader;
pub use loss::{LossConfig, Losses, Terms};
pub use mixture::{Drawn, Mixture};
pub use random::Random;
pub use read_config::read_config;
pub use run::{Event, Outcome, RunOptions, run};
pub use session::Session;
pub use source::Source;
