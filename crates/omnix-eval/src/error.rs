//! What can be wrong with predictions, truth and the files they come from. Messages name the thing and the cure, the path last.

use std::io;
use std::path::PathBuf;

/// An error of a metric, a reader or a report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// A file or folder that cannot be read.
    #[error("cannot read: check that it exists and is readable: {path}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file that cannot be written.
    #[error("cannot write: check the folder's permissions and the disk: {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file that is not what its name or place says.
    #[error("not a readable {what} ({reason}): replace it or copy it again: {path}")]
    Format {
        /// What it should be.
        what: &'static str,
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A file that would take more memory than an evaluation may.
    #[error("it holds {bytes} bytes, and at most {most} are read at once: split it into shorter sequences: {path}")]
    TooLarge {
        /// Bytes it holds, as far as they were counted.
        bytes: u64,
        /// Bytes that may be read.
        most: u64,
        /// The file.
        path: PathBuf,
    },
    /// An archive without an array that is needed.
    #[error("there is no array \"{name}\" (found: {found}): write it with that name: {path}")]
    Missing {
        /// The array.
        name: String,
        /// The names that are there.
        found: String,
        /// The archive.
        path: PathBuf,
    },
    /// An array of another shape than its meaning demands.
    #[error("{name} has the shape {found:?} where {expected} is needed: {path}")]
    Shape {
        /// The array.
        name: String,
        /// The shape needed, in words.
        expected: String,
        /// The shape found.
        found: Vec<usize>,
        /// The file.
        path: PathBuf,
    },
    /// Prediction and truth of different counts.
    #[error(
        "{what}: the prediction has {predicted} and the truth {truth}; predict every one of the truth, in its order"
    )]
    Counts {
        /// What is counted.
        what: String,
        /// In the prediction.
        predicted: usize,
        /// In the truth.
        truth: usize,
    },
    /// Times of prediction and truth that have nothing in common.
    #[error(
        "no time of the prediction ({predicted:?} s) is within {tolerance} s of one of the truth ({truth:?} s): give both the same clock"
    )]
    NoOverlap {
        /// First and last time of the prediction.
        predicted: [f64; 2],
        /// First and last time of the truth.
        truth: [f64; 2],
        /// The largest difference that counts as the same time.
        tolerance: f64,
    },
    /// Whoever runs the network that is evaluated failed.
    #[error("the network could not be run on a clip: {0}")]
    Run(Box<dyn std::error::Error + Send + Sync>),
    /// A sample of ground truth that cannot be used.
    #[error(transparent)]
    Sample(#[from] omnix_data::DataError),
    /// Nothing that could be scored.
    #[error("nothing can be scored: {reason}")]
    Nothing {
        /// Why, with the cure.
        reason: String,
    },
    /// Positions that determine no alignment.
    #[error(
        "the positions determine no alignment ({reason}): a camera that stands still or moves on a line has none; leave the sequence out and say so"
    )]
    Degenerate {
        /// What is degenerate.
        reason: &'static str,
    },
    /// A parameter outside its range.
    #[error("{name} is {value}: {expected}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// A folder in which no sequence was recognised.
    #[error("no sequence was found ({layout}): {path}")]
    NoSequences {
        /// The layouts that are recognised.
        layout: &'static str,
        /// The folder.
        path: PathBuf,
    },
}

impl EvalError {
    pub(crate) fn format(what: &'static str, reason: impl Into<String>, path: impl Into<PathBuf>) -> Self {
        Self::Format { what, reason: reason.into(), path: path.into() }
    }

    pub(crate) fn counts(what: impl Into<String>, predicted: usize, truth: usize) -> Self {
        Self::Counts { what: what.into(), predicted, truth }
    }

    /// Checks that two counts agree.
    pub(crate) fn expect(what: &str, predicted: usize, truth: usize) -> Result<(), Self> {
        if predicted == truth { Ok(()) } else { Err(Self::counts(what, predicted, truth)) }
    }
}
