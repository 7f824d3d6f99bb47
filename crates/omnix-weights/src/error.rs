//! What can be wrong with a checkpoint. Every message names the thing and the cure, the path last.

use std::path::PathBuf;

use omnix_tensors::TensorError;

use crate::report::CheckReport;

/// An error of opening, reading or checking a checkpoint.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Nothing is at the path given.
    #[error(
        "no checkpoint there: give a folder with config.json and model.safetensors, or a .safetensors, .pt, .pth or .ckpt file{}: {}",
        not_cached(.looked), path.display()
    )]
    NotFound {
        /// The path as given.
        path: PathBuf,
        /// The folder of the hub's cache where a repository of that name would be.
        looked: Option<PathBuf>,
    },

    /// The folder holds no file of the expected name.
    #[error("the folder holds no model.safetensors{}: {}", found_files(.found), path.display())]
    NoWeights {
        /// The folder.
        path: PathBuf,
        /// Other files of tensors in it, by name; one of them may be given instead of the folder.
        found: Vec<String>,
    },

    /// `config.json` is not beside the weights, and their tensors are not those of a published network that can be told by them.
    #[error("config.json is missing, and the tensors alone do not say which network it is; the checkpoint's own config.json belongs beside its weights: {}", path.display())]
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

    /// A file of tensors is absent, damaged or something else.
    #[error(transparent)]
    Tensors(#[from] TensorError),

    /// The folder cannot be listed.
    #[error("cannot list the folder: {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's answer.
        #[source]
        source: std::io::Error,
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

    /// A checkpoint where another is to be written.
    #[error("a checkpoint is there already; give a folder without one: {}", path.display())]
    InTheWay {
        /// The file that is there.
        path: PathBuf,
    },

    /// Whoever was told of the progress broke off.
    #[error("interrupted")]
    Interrupted,

    /// The tensors are not those of the expected network.
    #[error("the weights do not fit their configuration: {report}")]
    Mismatch {
        /// Every difference.
        report: Box<CheckReport>,
    },
}

impl CheckReport {
    /// The report itself when the network can be loaded, so that surplus tensors can be told.
    ///
    /// # Errors
    /// [`WeightsError::Mismatch`] naming the first differences of each kind, their number, and what the file seems to be.
    pub fn into_result(self) -> Result<Self, WeightsError> {
        if self.is_usable() { Ok(self) } else { Err(WeightsError::Mismatch { report: Box::new(self) }) }
    }
}

fn not_cached(looked: &Option<PathBuf>) -> String {
    let looked = looked.as_ref().map(|folder| {
        format!(" (or download that repository of the Hugging Face hub: it is not in {})", folder.display())
    });
    looked.unwrap_or_default()
}

fn found_files(found: &[String]) -> String {
    if found.is_empty() { String::new() } else { format!(" (but {}; give that file's path instead)", found.join(", ")) }
}
