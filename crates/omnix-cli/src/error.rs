//! What ends the program, and with which exit code.

use std::path::PathBuf;

use omnix::OmnixError;
use omnix::graph::GraphError;
use omnix::io::IoError;
use omnix::kernels::KernelError;

use crate::bytes;

/// Shown by `--help`.
pub(crate) const EXIT_CODES: &str = "\
Exit codes:
  0    success
  1    failure while running
  2    wrong usage: unknown options, values or names
  3    bad input: files, pictures, videos or weights
  4    no usable device, or the device was lost
  5    too large: the memory budget is too small, memory ran out, or more than an hour of work that nobody asked for by number
  6    output cannot be written: permissions, or the disk is full
  130  interrupted: what was finished is readable";

/// Errors of the program.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// From the engine or the files.
    #[error(transparent)]
    Omnix(#[from] OmnixError),
    /// Options that do not go together, found after parsing.
    #[error("{0}")]
    Usage(String),
    /// The run does not fit the budget or the device; with what would.
    #[error("{source}{suggestion}")]
    TooLarge {
        /// Says what is needed.
        source: OmnixError,
        /// Starts with a separator; empty if there is none.
        suggestion: String,
    },
    /// So much work that it is hardly meant.
    #[error(
        "{images} images need {tera_flops:.0} TFLOP, about {hours:.0} hours on this kind of device: choose some with --frames N \
         or --fps F (--frames {images} runs them all)"
    )]
    TooMuch {
        /// Number of images.
        images: usize,
        /// 10^12 operations.
        tera_flops: f64,
        /// By a rough guess of the device's speed.
        hours: f64,
    },
    /// A picture smaller than a patch.
    #[error("a picture of {width} x {height} pixels is smaller than one patch of the network (14 x 14): replace or remove {}", path.display())]
    TinyPicture {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The file.
        path: PathBuf,
    },
    /// `weights check` found something.
    #[error("{problems} problem(s) in the weights: {}", path)]
    BadWeights {
        /// How many.
        problems: usize,
        /// What was checked.
        path: String,
    },
    /// Writing to standard output failed.
    #[error("cannot write to standard output")]
    Stdout(#[source] std::io::Error),
    /// Another file of the program's own, such as a trace.
    #[error("cannot write {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The disk has no room for what a run would write.
    #[error(
        "the results would take about {} and {} has {} free: free some, choose another --out, or ask for less (--export, --points)",
        bytes::show(*needed), dir.display(), bytes::show(*free)
    )]
    DiskSpace {
        /// Bytes that the exports would take, roughly.
        needed: u64,
        /// Bytes that may be written.
        free: u64,
        /// The output folder.
        dir: PathBuf,
    },
    /// Ctrl-C after the geometry.
    #[error("interrupted: depth and cameras of all {images} images were finished and can be read in {}; what moves was not", dir.display())]
    MotionInterrupted {
        /// Images in all.
        images: usize,
        /// The output folder.
        dir: PathBuf,
    },
    /// Ctrl-C.
    #[error("interrupted: {finished} of {images} images were finished and can be read in {}", dir.display())]
    Interrupted {
        /// Images whose results were written.
        finished: usize,
        /// Images in all.
        images: usize,
        /// The output folder.
        dir: PathBuf,
    },
}

impl From<IoError> for CliError {
    fn from(error: IoError) -> Self {
        Self::Omnix(error.into())
    }
}

impl From<KernelError> for CliError {
    fn from(error: KernelError) -> Self {
        Self::Omnix(error.into())
    }
}

impl From<GraphError> for CliError {
    fn from(error: GraphError) -> Self {
        Self::Omnix(error.into())
    }
}

impl CliError {
    /// See [`EXIT_CODES`].
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Omnix(error) => library_code(error),
            Self::Usage(_) => 2,
            Self::TinyPicture { .. } | Self::BadWeights { .. } => 3,
            Self::TooLarge { .. } | Self::TooMuch { .. } => 5,
            Self::Stdout(_) | Self::File { .. } | Self::DiskSpace { .. } => 6,
            Self::Interrupted { .. } | Self::MotionInterrupted { .. } => 130,
        }
    }

    /// A word for machines.
    pub(crate) fn kind(&self) -> &'static str {
        match self.exit_code() {
            2 => "usage",
            3 => "input",
            4 => "device",
            5 => "too_large",
            6 => "output",
            130 => "interrupted",
            _ => "runtime",
        }
    }
}

fn library_code(error: &OmnixError) -> u8 {
    match error {
        OmnixError::Kernel(kernel) | OmnixError::Graph(GraphError::Kernel(kernel)) => match kernel {
            KernelError::OutOfMemory { .. } | KernelError::RowTooLarge { .. } => 5,
            KernelError::Unsupported { .. } => 1,
            _ => 4,
        },
        OmnixError::Graph(GraphError::TensorTooLarge { .. }) | OmnixError::Budget { .. } => 5,
        OmnixError::Graph(GraphError::Parameter { .. } | GraphError::DoesNotFit { .. }) => 3,
        OmnixError::Model(omnix::model::ModelError::Request { .. }) => 2,
        OmnixError::Model(_)
        | OmnixError::Weights(_)
        | OmnixError::NotBuiltIn { .. }
        | OmnixError::NonFinite { .. } => 3,
        OmnixError::Io(io) => file_code(io),
        OmnixError::Request { .. } | OmnixError::NoMotion { .. } | OmnixError::Query { .. } => 2,
        OmnixError::Interrupted => 130,
        _ => 1,
    }
}

fn file_code(error: &IoError) -> u8 {
    match error {
        IoError::BadChoice { .. } | IoError::UnknownName { .. } | IoError::MissingField { .. } => 2,
        IoError::OutputFolder { .. } | IoError::DiskFull { .. } | IoError::Write { .. } => 6,
        IoError::WrongSize { .. } | IoError::MissingTool { .. } => 1,
        _ => 3,
    }
}
