//! What can be wrong with a checkpoint. Every message names the thing and the cure, the path last.

use std::ops::Range;
use std::path::PathBuf;

use crate::CheckReport;

/// An error of opening, reading or checking a checkpoint.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Nothing is at the path given.
    #[error("no checkpoint there: give a folder with config.json and model.safetensors, or a .safetensors file: {}", path.display())]
    NotFound {
        /// The path as given.
        path: PathBuf,
    },

    /// The folder holds no file of the expected name.
    #[error("the folder holds no model.safetensors{}: {}", found_files(.found), path.display())]
    NoWeights {
        /// The folder.
        path: PathBuf,
        /// Other safetensors files in it, by name; one of them may be given instead of the folder.
        found: Vec<String>,
    },

    /// `config.json` is not beside the weights.
    #[error("config.json is missing; the checkpoint's own config.json belongs beside its weights: {}", path.display())]
    ConfigMissing {
        /// Where the file was expected.
        path: PathBuf,
    },

    /// `config.json` is not a JSON object.
    #[error("config.json is not a valid JSON object ({reason}); copy it again from where the checkpoint came from: {}", path.display())]
    ConfigInvalid {
        /// The file.
        path: PathBuf,
        /// What the parser said, with line and column.
        reason: String,
    },

    /// Reading failed.
    #[error("cannot {action}: {}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's answer.
        #[source]
        source: std::io::Error,
    },

    /// A PyTorch pickle: `.pt`, `.pth`, `.ckpt` or `.bin`.
    #[error("a PyTorch checkpoint cannot be read directly; convert it to safetensors (names unchanged) first: {}", path.display())]
    PyTorch {
        /// The file.
        path: PathBuf,
    },

    /// The bytes are something else.
    #[error("not a safetensors file ({reason}); get the file again: {}", path.display())]
    NotSafetensors {
        /// The file.
        path: PathBuf,
        /// What was found instead.
        reason: String,
    },

    /// The header parses but contradicts itself.
    #[error("damaged safetensors header: tensor {tensor}: {reason}; get the file again: {}", path.display())]
    BadHeader {
        /// The file.
        path: PathBuf,
        /// The tensor whose entry is wrong.
        tensor: String,
        /// What is wrong with it.
        reason: String,
    },

    /// The file is shorter (or longer) than its header says.
    #[error(
        "the file is {}: its header says {expected} bytes, it has {found}; get it again: {}",
        if found < expected { "truncated" } else { "longer than it should be" }, path.display()
    )]
    WrongLength {
        /// The file.
        path: PathBuf,
        /// Bytes by the header.
        expected: u64,
        /// Bytes there are.
        found: u64,
    },

    /// The index of a sharded checkpoint is wrong.
    #[error("the index of a sharded checkpoint is wrong ({reason}); get its files again: {}", path.display())]
    BadIndex {
        /// The index file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },

    /// A shard named by the index is absent.
    #[error("the shard {shard} of the checkpoint is missing; put it beside the index: {}", path.display())]
    ShardMissing {
        /// The index file.
        path: PathBuf,
        /// The file name of the shard.
        shard: String,
    },

    /// No tensor of that name.
    #[error("no tensor {tensor} in the checkpoint; is it of another model than its config.json? {}", path.display())]
    TensorMissing {
        /// The full name, prefix included.
        tensor: String,
        /// The checkpoint.
        path: PathBuf,
    },

    /// The tensor's element type is not a floating-point type this crate converts.
    #[error("tensor {tensor} has type {dtype}; convert the checkpoint to F32, F16, BF16 or F64: {}", path.display())]
    UnsupportedDtype {
        /// The full name, prefix included.
        tensor: String,
        /// The type as the header writes it.
        dtype: String,
        /// The checkpoint.
        path: PathBuf,
    },

    /// A range of elements that the tensor does not have, or a destination of another length.
    #[error("elements {}..{} into {destination} places, of a tensor of {elements}", range.start, range.end)]
    BadRange {
        /// The range asked for.
        range: Range<usize>,
        /// Elements in the tensor.
        elements: usize,
        /// Length of the destination.
        destination: usize,
    },

    /// The tensors are not those of the expected network.
    #[error("the weights do not fit their configuration: {report}")]
    Mismatch {
        /// Every difference.
        report: Box<CheckReport>,
    },
}

impl WeightsError {
    pub(crate) fn io(action: &'static str, path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }
}

fn found_files(found: &[String]) -> String {
    if found.is_empty() { String::new() } else { format!(" (but {}; give that file's path instead)", found.join(", ")) }
}
