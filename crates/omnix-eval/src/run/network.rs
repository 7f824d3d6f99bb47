//! A network, as evaluations see it, and the clips that it sees.

use omnix_geometry::Camera;
use omnix_io::Picture;

use crate::EvalError;

/// T pictures of one size, which the network sees together.
#[derive(Debug, Clone)]
pub struct Clip {
    /// Width and height.
    pub size: [u32; 2],
    /// `[T]`, of that size.
    pub pictures: Vec<Picture>,
    /// `[T]` (video, frame), as the network is told.
    pub times: Vec<(u32, u32)>,
}

/// What a network says of a clip of T pictures of H x W pixels.
#[derive(Debug, Clone)]
pub struct Seen {
    /// `[T][H][W]` z-depth.
    pub depth: Vec<f32>,
    /// `[T]`, world-to-camera, in the unit of depth; intrinsics in pixels of the clip. None of a network that makes no cameras.
    pub cameras: Vec<Camera>,
}

/// A network, as evaluations see it. Whatever keeps it from running is an [`EvalError::Run`], and ends the evaluation.
pub trait Network {
    /// Its name, for tables.
    fn name(&self) -> String;

    /// The size at which it takes pictures of this width and height: multiples of 14.
    fn size(&self, picture: [u32; 2]) -> [u32; 2];

    /// Whether it says where points go.
    fn has_paths(&self) -> bool;

    /// Runs over a clip.
    ///
    /// # Errors
    /// [`EvalError::Run`].
    fn see(&mut self, clip: &Clip) -> Result<Seen, EvalError>;

    /// Where the points of pixels (column, row; none for all, row by row) of an image of the clip seen last are at the times of the clip:
    /// `[T][pixel]`, in the world of the cameras. Asked of networks with paths alone.
    ///
    /// # Errors
    /// [`EvalError::Run`].
    fn paths(&mut self, image: usize, pixels: Option<&[[u32; 2]]>) -> Result<Vec<[f32; 3]>, EvalError>;
}
