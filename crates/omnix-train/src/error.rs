//! What can be wrong with a training run. Messages name the thing and the cure, the path last.

use std::path::PathBuf;

use omnix_data::DataError;
use omnix_graph::GraphError;
use omnix_io::IoError;
use omnix_model::ModelError;
use omnix_scenes::ScenesError;
use omnix_tensors::TensorError;
use omnix_weights::WeightsError;

/// Whatever goes wrong while a step is computed.
pub type StepError = Box<dyn std::error::Error + Send + Sync>;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A configuration that cannot be read.
    #[error("the configuration cannot be used: {reason}: {}", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the line.
        reason: String,
    },
    /// A setting that cannot be, alone or beside others.
    #[error("{key}: {cure}")]
    Contradiction {
        /// The setting.
        key: String,
        /// What can be.
        cure: String,
    },
    /// A tensor that no group of the configuration takes.
    #[error(
        "no group takes the tensor {tensor}: add one for it, or a last one with the name \"\" for all that is left"
    )]
    NoGroup {
        /// The tensor.
        tensor: String,
    },
    /// A tensor that does not fit a buffer.
    #[error(
        "the tensor {tensor} has more than {most} numbers, which no buffer holds: freeze it, or train a smaller network"
    )]
    TensorTooLarge {
        /// The tensor.
        tensor: String,
        /// Numbers that a buffer holds.
        most: usize,
    },
    /// No tensor is trained.
    #[error("no tensor is trained: all groups are frozen, or the losses do not depend on what is not")]
    NothingTrains,
    /// A start value that is no number.
    #[error("{tensor}[{index}] of the checkpoint to start from is {value}: start from another one: {}", path.display())]
    StartNotFinite {
        /// The tensor.
        tensor: String,
        /// Index of the number.
        index: usize,
        /// What it is.
        value: f32,
        /// The checkpoint.
        path: PathBuf,
    },
    /// A checkpoint to start from that has nothing in common with the network.
    #[error("no tensor of the checkpoint to start from fits the network by name and shape: {}", path.display())]
    NothingFits {
        /// The checkpoint.
        path: PathBuf,
    },
    /// A sample without images or pixels, or too large a one.
    #[error("samples of {images} images of {} x {} pixels cannot be made: choose 1 to 1000 images of a few hundred pixels", size[0], size[1])]
    SampleSize {
        /// Number of images.
        images: u32,
        /// Width and height.
        size: [u32; 2],
    },
    /// A sample that cannot be had.
    #[error("sample {number}, from {label}, cannot be had")]
    Sample {
        /// Its number in the run.
        number: u64,
        /// The source's label.
        label: String,
        /// Why.
        #[source]
        source: Box<TrainError>,
    },
    /// A number that is NaN or infinite.
    #[error(
        "{what} is NaN or infinite in step {step}, at sample {sample} ({label}); the last checkpoint is of a step before it: \
         lower the rate or the clip, or look at the sample"
    )]
    NotFinite {
        /// The loss, or the tensor.
        what: String,
        /// The step, from 1.
        step: u64,
        /// The sample's number, the last one of the step.
        sample: u64,
        /// The label of the sample's source.
        label: String,
    },
    /// A weight or moment that is NaN or infinite.
    #[error(
        "{tensor}[{index}] or its moments are {value}; the former checkpoint stays as it is: lower the rate, and go on from there"
    )]
    StateNotFinite {
        /// The tensor.
        tensor: String,
        /// Index of the number.
        index: usize,
        /// What it is.
        value: f32,
    },
    /// The machine that computes steps failed.
    #[error("a step of training failed")]
    Step(#[source] StepError),
    /// Another process of the training failed, so that all have stopped.
    #[error("process {rank} of this training, on {host}, has failed, and all have stopped: {reason}")]
    Peer {
        /// Its rank.
        rank: u32,
        /// Its machine.
        host: String,
        /// What it said.
        reason: String,
    },
    /// Processes of a training that do not train the same.
    #[error(
        "process {rank} of this training has another configuration, or is another version of the program, than the first one: start all with \
         the same"
    )]
    PeerRecipe {
        /// Its rank.
        rank: u32,
    },
    /// Processes of a training that do not start from the same state.
    #[error(
        "process {rank} of this training goes on from step {found}, the first one from step {expected}: all must see the same folder, \
         on a disk that they share"
    )]
    PeerState {
        /// Its rank.
        rank: u32,
        /// The step that it found.
        found: u64,
        /// The step that the first one found.
        expected: u64,
    },
    /// Processes of a training whose weights would drift apart, since each changes its own.
    #[error(
        "process {rank} of this training computes on {found}, the first one on {expected}, and would come to other weights: run all on devices \
         of one kind with one driver"
    )]
    PeerDevice {
        /// Its rank.
        rank: u32,
        /// Its device.
        found: String,
        /// That of the first one.
        expected: String,
    },
    /// A checkpoint of another network.
    #[error("the folder holds a checkpoint of another network ({field}): choose another --out, or train that network: {}", path.display())]
    OtherNetwork {
        /// The checkpoint.
        path: PathBuf,
        /// The first field in which they differ, with both values.
        field: String,
    },
    /// A checkpoint of a newer program.
    #[error("the checkpoint was written by version {version}, which is newer than this program: use that version: {}", path.display())]
    NewerCheckpoint {
        /// The checkpoint.
        path: PathBuf,
        /// The version that wrote it.
        version: String,
    },
    /// A checkpoint that is damaged.
    #[error("the checkpoint is damaged ({reason}): take another one, or remove it to start anew: {}", path.display())]
    BadCheckpoint {
        /// The checkpoint.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// A failure of writing.
    #[error("cannot write: check the folder's permissions and the space on the disk: {}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// A file of tensors that cannot be read or written.
    #[error(transparent)]
    Tensors(#[from] TensorError),
    /// A checkpoint that cannot be read.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A network that cannot be.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Data that cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Scenes that cannot be made.
    #[error(transparent)]
    Scenes(#[from] ScenesError),
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] IoError),
    /// A field of the loss' configuration with a value that cannot be.
    #[error("loss.{field} is {value}: {allowed}")]
    BadLoss {
        /// The field, with the path to it.
        field: &'static str,
        /// What is there.
        value: String,
        /// What may be there.
        allowed: &'static str,
    },
    /// An objective without any term.
    #[error("there is no loss to compute: give at least one of depth, rays, camera, tracks, displacement and score")]
    NoTerms,
    /// Host arrays that do not belong together.
    #[error("{what}: {got} numbers, expected {expected}")]
    Length {
        /// Which array.
        what: &'static str,
        /// How many numbers it should have.
        expected: usize,
        /// How many it has.
        got: usize,
    },
    /// A sample of another shape than the step was planned for.
    #[error(
        "a sample of {images} images of {} x {} pixels; this training takes {expected_images} of {} x {}",
        size[0], size[1], expected[0], expected[1]
    )]
    OtherSize {
        /// Images of the sample.
        images: usize,
        /// Their width and height.
        size: [u32; 2],
        /// Images that a step takes.
        expected_images: usize,
        /// Their width and height.
        expected: [u32; 2],
    },
    /// A graph that could not be recorded, planned or run.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

impl TrainError {
    /// A setting that cannot be, with its cure.
    pub(crate) fn contradiction(key: &str, cure: &str) -> Self {
        Self::Contradiction { key: key.to_owned(), cure: cure.to_owned() }
    }
}
