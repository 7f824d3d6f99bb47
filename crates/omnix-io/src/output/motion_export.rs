//! Exports of motion by name: from chosen points in one call, or one source image at a time.
//!
//! A run with motion calls [`write_motion`] with the chosen points for the exports whose [`Export::motion_input`] is
//! [`super::MotionInput::Points`], and feeds a [`MotionStream`] for those with [`super::MotionInput::Images`]. `tracks` goes either way:
//! through the stream when all pixels are wanted.

use std::path::{Path, PathBuf};

use super::{
    atomic::check_output_folder,
    export::Export,
    motion::{MotionView, MovingPoints, SourceMotion, check_views},
    options::MotionOptions,
};
use crate::IoError;

/// Writes those of `exports` that are made of chosen points into `dir` and returns the files'
/// paths. Others are passed over.
///
/// # Errors
/// Points that contradict each other or the images; cameras that cannot be inverted; a failure of writing.
pub fn write_motion(
    exports: &[Export],
    points: &MovingPoints,
    dir: &Path,
    options: &MotionOptions,
) -> Result<Vec<PathBuf>, IoError> {
    let mut written = Vec::new();
    for write in exports.iter().filter_map(|export| export.format().points) {
        written.extend(write(dir, points, options)?);
    }
    Ok(written)
}

/// Writes exports from one source image at a time, in any order. Each file is whole when its image returns.
pub struct MotionStream {
    exports: Vec<Export>,
    views: Vec<MotionView>,
    dir: PathBuf,
    written: Vec<PathBuf>,
}

impl MotionStream {
    /// Starts the exports of the list that are written image by image; `tracks` counts among them, so leave it out of
    /// [`write_motion`]'s list then. `views` are all images.
    ///
    /// # Errors
    /// Pictures of different sizes; an output folder that cannot be written to.
    pub fn open(exports: &[Export], views: Vec<MotionView>, dir: &Path) -> Result<Self, IoError> {
        let kept = |e: &Export| e.format().images.is_some();
        let exports: Vec<Export> = exports.iter().copied().filter(kept).collect();
        if let Some(export) = exports.first() {
            check_output_folder(dir)?;
            check_views(&views, export.name())?;
        }
        Ok(Self { exports, views, dir: dir.to_owned(), written: Vec::new() })
    }

    /// Whether there is nothing to write.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.exports.is_empty()
    }

    /// Whether image `index` must come with the paths of its points: for `tracks` every image, for `st4rtrack` the first.
    #[must_use]
    pub fn wants_trajectory(&self, index: usize) -> bool {
        self.exports.iter().filter_map(|e| e.format().images.as_ref()).any(|w| (w.wants_trajectory)(index))
    }

    /// Writes the files of one image.
    ///
    /// # Errors
    /// Buffers of a wrong length, paths or pixels missing where an export needs them; a failure of writing.
    pub fn image(&mut self, image: &SourceMotion<'_>) -> Result<(), IoError> {
        for writer in self.exports.iter().filter_map(|e| e.format().images.as_ref()) {
            self.written.extend((writer.write)(&self.dir, &self.views, image)?);
        }
        Ok(())
    }

    /// Paths of all files written.
    #[must_use]
    pub fn finish(self) -> Vec<PathBuf> {
        self.written
    }
}
