//! Why the checks could not be made.

use std::path::PathBuf;

/// The checks could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XtaskError {
    /// A file or folder of the tree could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A command that the checks need could not be started.
    #[error("cannot run {command}; it must be on the PATH")]
    Command {
        /// The command line.
        command: String,
        /// Why.
        source: std::io::Error,
    },
    /// A command that the checks need failed.
    #[error("{command} failed: {stderr}")]
    CommandFailed {
        /// The command line.
        command: String,
        /// What it said.
        stderr: String,
    },
    /// `cargo metadata` printed something else than the JSON that its manual describes.
    #[error("cargo metadata printed no such JSON as expected: {what}")]
    Metadata {
        /// What is missing or wrong.
        what: String,
    },
}
