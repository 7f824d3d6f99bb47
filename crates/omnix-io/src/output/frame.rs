//! What a run hands to the exports of single images, and what receives it.

use std::path::PathBuf;

use crate::IoError;

/// The result of one image. Maps are row-major, `[height][width]`.
#[derive(Debug, Clone, Copy)]
pub struct FrameResult<'a> {
    /// Global index of the image; sinks get images in ascending order.
    pub index: usize,
    /// Video index.
    pub video: u32,
    /// Frame number in its video.
    pub frame: u32,
    /// Presentation time in seconds, if the input has one.
    pub time_s: Option<f64>,
    /// Width of all maps in pixels.
    pub width: u32,
    /// Height of all maps in pixels.
    pub height: u32,
    /// Depth along the camera's z axis, in the run's unit.
    pub depth: &'a [f32],
    /// Confidence, at least 1 for Depth Anything 3.
    pub confidence: Option<&'a [f32]>,
    /// The processed picture, 8-bit RGB, interleaved.
    pub rgb: &'a [u8],
    /// World-to-camera `[R|t]`, OpenCV axes.
    pub extrinsics: Option<[[f32; 4]; 3]>,
    /// Intrinsics in pixels of these maps, pixel positions at whole numbers.
    pub intrinsics: Option<[[f32; 3]; 3]>,
    /// Pixels that are sky; no points are made of them.
    pub sky: Option<&'a [bool]>,
}

impl FrameResult<'_> {
    /// Checks the length of every buffer.
    pub(super) fn check(&self, export: &'static str) -> Result<(), IoError> {
        let pixels = self.width as usize * self.height as usize;
        let lengths = [
            ("depth", self.depth.len(), pixels),
            ("confidence", self.confidence.map_or(pixels, <[f32]>::len), pixels),
            ("picture", self.rgb.len(), 3 * pixels),
            ("sky", self.sky.map_or(pixels, <[bool]>::len), pixels),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(IoError::WrongSize { export, what, index: self.index, expected, found });
            }
        }
        Ok(())
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RunSummary {
    /// Whether it was stopped before its last image.
    pub interrupted: bool,
}

/// Receives results, one image at a time in ascending order, and writes one export format.
pub trait Sink: Send {
    /// Takes the result of one image.
    ///
    /// # Errors
    /// A full disk or other failure of writing; a camera missing where the format needs one; buffers of a wrong length.
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError>;

    /// Completes the files and returns their paths. A run that wrote no image returns no path.
    ///
    /// # Errors
    /// A full disk or other failure of writing; then no file of that format appears that is not whole.
    fn finish(self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError>;
}
