//! What ends the program, and with which exit code.

use std::path::PathBuf;

use omnix::OmnixError;
use omnix::checkpoint::{TensorError, WeightsError};
use omnix::graph::GraphError;
use omnix::io::IoError;
use omnix::kernels::KernelError;
use omnix_data::DataError;
use omnix_eval::EvalError;
use omnix_scenes::ScenesError;
use omnix_train::TrainError;

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
  130  interrupted (Ctrl-C, SIGTERM, SIGHUP): what was finished is readable";

/// Errors of the program.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// From the engine or the files.
    #[error(transparent)]
    Omnix(OmnixError),
    /// From training.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A training that was asked to stop.
    #[error("interrupted after step {step}; the same command goes on from there: {}", out.display())]
    TrainingInterrupted {
        /// Steps done.
        step: u64,
        /// The folder with the checkpoint.
        out: PathBuf,
    },
    /// From an evaluation.
    #[error(transparent)]
    Eval(EvalError),
    /// From scenes.
    #[error(transparent)]
    Scenes(#[from] ScenesError),
    /// Options that do not go together, found after parsing.
    #[error("{0}")]
    Usage(String),
    /// The run does not fit the budget or the device; with what would.
    #[error("{source}{suggestion}")]
    TooLarge {
        /// Says what is needed.
        source: OmnixError,
        /// Starts with a separator; empty without a suggestion.
        suggestion: String,
    },
    /// One array of the run is larger than a buffer of the device may be.
    #[error(
        "{run} one array of {}, and the largest buffer of this device has {}: use fewer or smaller images{suggestion}",
        bytes::show(*needed), bytes::show(*limit)
    )]
    TensorTooLarge {
        /// Who needs it: "10000 images need".
        run: String,
        /// Bytes of the array.
        needed: u64,
        /// The device's limit.
        limit: u64,
        /// Starts with a separator; empty without a suggestion.
        suggestion: String,
    },
    /// Results of a run among the inputs.
    #[error("{reason}: move results away from pictures, or name the pictures themselves: {}", path.display())]
    ResultsAsInputs {
        /// Where they are, in words.
        reason: String,
        /// The first such input.
        path: PathBuf,
    },
    /// The system gives no threads, not even as many as there are.
    #[error("the threads of the program could not be started")]
    Threads(#[source] rayon::ThreadPoolBuildError),
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
    /// A picture that takes more memory to decode than it may.
    #[error(
        "a picture of {width} x {height} pixels takes {} to decode, and {} may be used: make it smaller, or allow more with \
         --memory-budget: {}",
        bytes::show(*needed), bytes::show(*most), path.display()
    )]
    LargePicture {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Bytes that decoding takes at most.
        needed: u64,
        /// Bytes that it may take.
        most: u64,
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
    /// From a data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// `data check` found something.
    #[error("{scenes} scene(s) with problems, or that cannot be read, as said above: {}", path.display())]
    BadData {
        /// Their number.
        scenes: usize,
        /// What was checked.
        path: PathBuf,
    },
    /// Ctrl-C between the scenes of a data set.
    #[error("interrupted: {looked_at} of {scenes} scenes were checked")]
    CheckInterrupted {
        /// Scenes that were checked.
        looked_at: usize,
        /// Scenes in all.
        scenes: usize,
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
    /// A limit of file sizes below the memory of a software device.
    #[error(
        "files of this process may have {} (ulimit -f), and this software device keeps the memory of a run, {}, in a file: raise the limit",
        bytes::show(*limit), bytes::show(*needed)
    )]
    FileLimit {
        /// Bytes that a file may have.
        limit: u64,
        /// Bytes of the run on the device.
        needed: u64,
    },
    /// A folder that has no points.
    #[error(
        "there is nothing to render, neither field.safetensors nor exports/npz/results.npz nor a scene with depth: reconstruct again \
         with --export field (what moves, too) or npz: {}", path.display()
    )]
    NothingToRender {
        /// The folder.
        path: PathBuf,
    },
    /// Pictures of more points than there is memory for.
    #[error(
        "these pictures take {} and {} may be used: --points draws fewer points, --size makes smaller pictures", bytes::show(*needed),
        bytes::show(*budget)
    )]
    PicturesTooLarge {
        /// Bytes that they take.
        needed: u64,
        /// Bytes that may be taken.
        budget: u64,
    },
    /// Ctrl-C between the pictures of a folder.
    #[error("interrupted: {finished} of {pictures} pictures were finished and are in {}", dir.display())]
    RenderInterrupted {
        /// Pictures that were written.
        finished: usize,
        /// Pictures in all.
        pictures: usize,
        /// Their folder.
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
    /// Ctrl-C among the windows of a film.
    #[error("interrupted: {done} of {windows} windows were finished; the same command goes on from there: {}", dir.display())]
    WindowsInterrupted {
        /// Windows that were finished.
        done: usize,
        /// Windows in all.
        windows: usize,
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

impl From<EvalError> for CliError {
    fn from(error: EvalError) -> Self {
        match error {
            // What kept the network from running ends the program as it would anywhere else.
            EvalError::Run(inner) => match inner.downcast::<Self>() {
                Ok(own) => *own,
                Err(inner) => Self::Eval(EvalError::Run(inner)),
            },
            EvalError::Sample(error) => Self::Data(error),
            other => Self::Eval(other),
        }
    }
}

impl From<OmnixError> for CliError {
    fn from(error: OmnixError) -> Self {
        match error {
            // Names inside of a graph say nothing to who runs the program.
            OmnixError::Graph(GraphError::TensorTooLarge { bytes, limit, .. }) => Self::TensorTooLarge {
                run: "this run needs".to_owned(),
                needed: bytes,
                limit,
                suggestion: String::new(),
            },
            other => Self::Omnix(other),
        }
    }
}

impl From<IoError> for CliError {
    fn from(error: IoError) -> Self {
        match error {
            IoError::Interrupted => Self::Omnix(OmnixError::Interrupted),
            other => Self::Omnix(other.into()),
        }
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
            Self::Train(error) => training_code(error),
            Self::TrainingInterrupted { .. } => 130,
            Self::Scenes(error) => scenes_code(error),
            Self::Threads(_) => 1,
            Self::Data(error) => data_code(error),
            Self::Eval(EvalError::Parameter { .. }) | Self::Usage(_) | Self::ResultsAsInputs { .. } => 2,
            Self::Eval(EvalError::Write { .. }) => 6,
            Self::Eval(EvalError::TooLarge { .. }) => 5,
            Self::Eval(_) | Self::TinyPicture { .. } | Self::BadWeights { .. } | Self::BadData { .. } => 3,
            Self::NothingToRender { .. } => 3,
            Self::TooLarge { .. } | Self::TensorTooLarge { .. } | Self::TooMuch { .. } | Self::LargePicture { .. } => 5,
            Self::PicturesTooLarge { .. } => 5,
            Self::Stdout(_) | Self::File { .. } | Self::DiskSpace { .. } | Self::FileLimit { .. } => 6,
            Self::Interrupted { .. }
            | Self::WindowsInterrupted { .. }
            | Self::MotionInterrupted { .. }
            | Self::CheckInterrupted { .. }
            | Self::RenderInterrupted { .. } => 130,
        }
    }

    /// The program's own words for what the libraries' errors advise: its options and commands.
    pub(crate) fn cure(&self) -> Option<&'static str> {
        match self {
            Self::Omnix(error) | Self::TooLarge { source: error, .. } => library_cure(error),
            Self::TensorTooLarge { .. } => Some(SMALLER),
            Self::ResultsAsInputs { .. } => Some(OTHER_FOLDER),
            Self::Data(DataError::UnknownSet { .. } | DataError::OtherSet { .. }) => Some("--set names the data set"),
            Self::Data(DataError::TooLarge { .. }) => Some("--images takes fewer images of each scene"),
            _ => None,
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

const SMALLER: &str =
    "--frames takes fewer images, --process-res or --size smaller ones; --weights-type f16 or i8 takes smaller weights";
const OTHER_FOLDER: &str = "--out names the output folder";

fn library_cure(error: &OmnixError) -> Option<&'static str> {
    match error {
        OmnixError::Kernel(kernel) | OmnixError::Graph(GraphError::Kernel(kernel)) => match kernel {
            KernelError::NoAdapter { .. } => Some(
                "`omnix devices` lists what there is, --device chooses one, and tools/setup installs Mesa's lavapipe, which needs no GPU",
            ),
            KernelError::OutOfMemory { .. } => Some(
                "--memory-budget bounds what a run takes; --frames takes fewer images, --process-res or --size smaller ones",
            ),
            KernelError::DeviceLost { .. } => Some("--device chooses another device"),
            _ => None,
        },
        OmnixError::Budget { .. } => Some(SMALLER),
        OmnixError::NoMotion { .. } => Some("--weights names a checkpoint, --export what is written"),
        OmnixError::Io(IoError::OutputFolder { .. } | IoError::FolderInUse { .. } | IoError::DiskFull { .. }) => {
            Some(OTHER_FOLDER)
        }
        _ => None,
    }
}

fn training_code(error: &TrainError) -> u8 {
    match error {
        TrainError::Contradiction { .. } | TrainError::NoGroup { .. } | TrainError::BadLoss { .. } => 2,
        TrainError::Graph(GraphError::Budget { .. } | GraphError::TensorTooLarge { .. })
        | TrainError::TensorTooLarge { .. } => 5,
        TrainError::Folder(error) => file_code(error),
        TrainError::Write { .. } => 6,
        TrainError::Step(_)
        | TrainError::Peer { .. }
        | TrainError::NotFinite { .. }
        | TrainError::StateNotFinite { .. } => 1,
        TrainError::Graph(_) => 1,
        _ => 3,
    }
}

fn scenes_code(error: &ScenesError) -> u8 {
    match error {
        ScenesError::Recipe { .. } | ScenesError::Parse(_) => 2,
        ScenesError::Texture { .. }
        | ScenesError::Model { .. }
        | ScenesError::Read { .. }
        | ScenesError::OtherJob { .. } => 3,
        ScenesError::Write { .. } | ScenesError::InUse { .. } => 6,
        ScenesError::Stopped => 130,
        _ => 1,
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
        OmnixError::Weights(WeightsError::Interrupted) => 130,
        OmnixError::Weights(
            WeightsError::InTheWay { .. } | WeightsError::Tensors(TensorError::Io { action: "write the file", .. }),
        ) => 6,
        OmnixError::Model(omnix::model::ModelError::Request { .. }) => 2,
        OmnixError::Model(_)
        | OmnixError::Weights(_)
        | OmnixError::NotBuiltIn { .. }
        | OmnixError::NonFinite { .. } => 3,
        OmnixError::Io(io) => file_code(io),
        OmnixError::Window(TensorError::Io { action: "write the file", .. }) => 6,
        OmnixError::Window(_) => 3,
        OmnixError::Request { .. } | OmnixError::NoMotion { .. } | OmnixError::Query { .. } => 2,
        OmnixError::Interrupted => 130,
        _ => 1,
    }
}

fn data_code(error: &DataError) -> u8 {
    match error {
        DataError::Picture(error) => file_code(error),
        DataError::TooLarge { .. } => 5,
        DataError::Write { .. } => 6,
        _ => 3,
    }
}

fn file_code(error: &IoError) -> u8 {
    match error {
        IoError::BadChoice { .. } | IoError::UnknownName { .. } | IoError::MissingField { .. } => 2,
        IoError::OutputFolder { .. }
        | IoError::FolderInUse { .. }
        | IoError::Vanished { .. }
        | IoError::DiskFull { .. }
        | IoError::TemporaryFull { .. }
        | IoError::FileTooLarge { .. }
        | IoError::Film { .. }
        | IoError::Write { .. } => 6,
        IoError::WrongSize { .. } | IoError::MissingTool { .. } | IoError::ToolStart { .. } => 1,
        IoError::PictureTooLarge { .. } => 5,
        IoError::Interrupted => 130,
        _ => 3,
    }
}
