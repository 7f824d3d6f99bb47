//! The prediction of a scene, a source image at a time: from a folder of archives of tracks, or from whoever runs a network.

use std::path::{Path, PathBuf};

use super::truth::LAYOUT;
use crate::EvalError;
use crate::files::tracks::{self, SourceTracks};

/// The predicted paths of a scene.
pub(crate) trait ScenePrediction {
    /// The indices of the source images that have paths, ascending; at least one.
    ///
    /// # Errors
    /// [`EvalError::NoSequences`] if there is none.
    fn sources(&mut self) -> Result<Vec<usize>, EvalError>;

    /// The paths of one of them.
    ///
    /// # Errors
    /// As its files have them; [`EvalError::Run`].
    fn source(&mut self, image: usize) -> Result<SourceTracks, EvalError>;

    /// Where that lies, for messages.
    fn place(&self, image: usize) -> PathBuf;
}

/// A folder of archives of tracks, one for each source image.
#[derive(Debug)]
pub(super) struct PredictionFolder {
    folder: PathBuf,
    /// By the index of their image.
    archives: Vec<(usize, PathBuf)>,
}

impl PredictionFolder {
    /// Lists a folder.
    ///
    /// # Errors
    /// [`EvalError::Read`]; [`EvalError::Format`] for an archive whose name is not the number of its image.
    pub(super) fn open(folder: &Path) -> Result<Self, EvalError> {
        let archives = tracks::archives(folder)?.into_iter().map(|path| Ok((tracks::source_index(&path)?, path)));
        Ok(Self { folder: folder.to_owned(), archives: archives.collect::<Result<_, EvalError>>()? })
    }
}

impl ScenePrediction for PredictionFolder {
    fn sources(&mut self) -> Result<Vec<usize>, EvalError> {
        if self.archives.is_empty() {
            return Err(EvalError::NoSequences { layout: LAYOUT, path: self.folder.clone() });
        }
        Ok(self.archives.iter().map(|(index, _)| *index).collect())
    }

    fn source(&mut self, image: usize) -> Result<SourceTracks, EvalError> {
        tracks::read(&self.place(image))
    }

    fn place(&self, image: usize) -> PathBuf {
        self.archives.iter().find(|(index, _)| *index == image).map_or_else(|| self.folder.clone(), |(_, p)| p.clone())
    }
}
