//! What can be wrong with a recipe, assets or an output.

use std::path::PathBuf;

use crate::clean::Refusal;
use crate::model::Flaw;

/// An error of scenes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenesError {
    /// A value of a recipe outside of what it can be.
    #[error("recipe: `{field}` is {value}, but must be {expected}")]
    Recipe {
        /// The field's name in the file.
        field: &'static str,
        /// What it is.
        value: String,
        /// What it can be.
        expected: &'static str,
    },

    /// A recipe that is not in the form of one.
    #[error("the recipe does not parse: {0}")]
    Parse(#[from] toml::de::Error),

    /// A picture that cannot be a texture.
    #[error("this picture cannot be used as a texture: {reason}; take it out of the folder: {path}", path = path.display())]
    Texture {
        /// Why.
        reason: String,
        /// The file.
        path: PathBuf,
    },

    /// A model that cannot be used, where there is nothing else.
    #[error("this model cannot be used: {flaw}; mend it or take it out of the folder: {path}", path = path.display())]
    Model {
        /// Why.
        #[source]
        flaw: Flaw,
        /// The file.
        path: PathBuf,
    },

    /// A file or folder that cannot be read.
    #[error("cannot read: {path}", path = path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        #[source]
        source: std::io::Error,
    },

    /// A file or folder that cannot be written.
    #[error("cannot write: {path}", path = path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        #[source]
        source: std::io::Error,
    },

    /// Another process writes the same scenes.
    #[error("another process writes this part of the scenes; wait for it or choose another folder: {path}", path = path.display())]
    InUse {
        /// The folder.
        path: PathBuf,
    },

    /// Somebody asked to stop.
    #[error("stopped: scenes that are whole are kept, and the same command goes on")]
    Stopped,

    /// A scene of the same index that was made otherwise.
    #[error("this scene was made of another recipe, seed or size, or is damaged; choose another folder or remove it: {path}", path = path.display())]
    OtherJob {
        /// The scene's folder.
        path: PathBuf,
    },

    /// A picture or text that could not be encoded.
    #[error("a file could not be encoded: {reason}")]
    Encode {
        /// Why.
        reason: String,
    },

    /// A sample that is not one: a bug of this crate.
    #[error(transparent)]
    Sample(#[from] omnix_data::DataError),

    /// No scene of a seed and index passed the checks.
    #[error("scene {index} of seed {seed}: all {tries} draws were refused ({reason}); widen the recipe")]
    Refused {
        /// The seed.
        seed: u64,
        /// The index.
        index: u64,
        /// Scenes drawn.
        tries: usize,
        /// Why the last one was.
        reason: Refusal,
    },
}
