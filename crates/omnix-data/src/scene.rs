//! A scene of a data set on disk: its videos, and what one image of them holds.

use std::path::Path;

use glam::DVec3;
use omnix_io::Picture;

use crate::rigid::Pinhole;
use crate::set::Set;
use crate::{DataError, Flag, Motion, Unit};

/// One camera's images in the order of time, or a collection of photographs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Video {
    /// Its name in the data set.
    pub name: String,
    /// Number of its images.
    pub frames: usize,
}

/// One image to be read, and what the network is told of its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Pick {
    /// Index of the video in the scene.
    pub video: usize,
    /// Index of the image in that video.
    pub frame: usize,
    /// Video index that the network is told.
    pub as_video: u32,
    /// Frame index that the network is told.
    pub as_frame: u32,
}

impl Pick {
    /// An image with its own indices.
    #[must_use]
    pub const fn plain(video: usize, frame: usize) -> Self {
        Self { video, frame, as_video: video as u32, as_frame: frame as u32 }
    }
}

/// One image with what its files say, at the size of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub(crate) image: Picture,
    pub(crate) camera: Pinhole,
    /// z-depth, row-major; whatever is not above 0 and finite is unknown.
    pub(crate) depth: Option<Vec<f32>>,
    pub(crate) moving: Option<Vec<Flag>>,
    pub(crate) moment: u32,
    pub(crate) seconds: Option<f64>,
}

impl View {
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.image.width as usize, self.image.height as usize]
    }
}

/// A scene of a data set.
pub trait Scene: std::fmt::Debug + Send + Sync {
    /// Which data set.
    fn set(&self) -> Set;

    /// Its folder.
    fn path(&self) -> &Path;

    /// Its videos. Images of one index in different videos were taken at one moment, unless the set says otherwise.
    fn videos(&self) -> &[Video];

    /// The unit of its lengths.
    fn unit(&self) -> Unit;

    /// Reads one image with what is known about it. The indices are those of existing images.
    ///
    /// # Errors
    /// A file that is missing, damaged or of another shape than the layout says.
    fn view(&self, video: usize, frame: usize) -> Result<View, DataError>;

    /// What is known about motion in the images of `picks`, which are read already and fitted to their size.
    ///
    /// # Errors
    /// As [`Scene::view`].
    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let _ = (picks, views);
        Ok(Motion::Unknown)
    }

    /// What is subtracted from positions of this scene before they are rounded to f32; where worlds are large.
    ///
    /// # Errors
    /// As [`Scene::view`].
    fn origin(&self) -> Result<DVec3, DataError> {
        Ok(DVec3::ZERO)
    }
}
