//! Checks of the tree that neither rustc nor clippy makes: `cargo xtask tidy`, and the same as tests in `tests/workspace`.
//!
//! [`places`]: a kernel is in its five places. [`text`]: length, header and leftovers of a file. [`arrows`]: which crate
//! may know which. Each check is a pure function from what was read to [`Finding`]s.

pub mod arrows;
pub mod places;
pub mod text;
pub mod tree;

use std::fmt;
use std::path::{Path, PathBuf};

pub use tree::Tree;

/// One thing that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Finding {
    /// File or package it is about; relative to the repository root, with `/`.
    pub place: String,
    /// What is wrong, and what to do about it.
    pub message: String,
    /// A warning is printed and passes.
    pub level: Level,
}

/// Whether a finding fails the check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Fails.
    Error,
    /// Is printed and passes.
    Warning,
}

impl Finding {
    fn error(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { place: place.into(), message: message.into(), level: Level::Error }
    }

    fn warning(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { place: place.into(), message: message.into(), level: Level::Warning }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let level = match self.level {
            Level::Error => "error",
            Level::Warning => "warning",
        };
        write!(f, "{level}: {}: {}", self.place, self.message)
    }
}

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

/// Root of the repository this was built from.
pub fn root() -> &'static Path {
    // tools/xtask is two levels below the root.
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().and_then(Path::parent).unwrap_or(here)
}

/// All checks of the tree under `root`, sorted by level, then place.
///
/// # Errors
/// [`XtaskError`] when the tree or `cargo metadata` cannot be read.
pub fn tidy(root: &Path) -> Result<Vec<Finding>, XtaskError> {
    let tree = Tree::read(root)?;
    let mut findings = places::check(&tree);
    findings.extend(text::check(&tree));
    findings.extend(arrows::check(&arrows::metadata(root)?)?);
    findings.sort_by(|a, b| (a.level, a).cmp(&(b.level, b)));
    Ok(findings)
}
