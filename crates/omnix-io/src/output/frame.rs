//! What a run hands to the exports of single images, and what receives it.

use std::path::PathBuf;

use omnix_geometry::GAUSSIAN_NUMBERS;

use crate::IoError;
use crate::preprocess::Framing;

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
    /// What a Gaussian head says of each pixel, [`omnix_geometry::GAUSSIAN_NUMBERS`] numbers.
    pub gaussians: Option<&'a [f32]>,
    /// What the encoder makes of its patches, after chosen blocks.
    pub features: &'a [FeatureMap<'a>],
    /// The picture that it was made of; exports for other tools name it and state cameras at its size.
    pub source: Option<SourcePicture<'a>>,
}

/// What the encoder makes of an image's patches after one of its blocks, `[rows, columns, channels]`.
#[derive(Debug, Clone, Copy)]
pub struct FeatureMap<'a> {
    /// The block, from 0.
    pub block: usize,
    /// Patch rows and columns.
    pub grid: [usize; 2],
    /// The numbers.
    pub values: &'a [f32],
}

/// A picture or a video's frame as it was before it came to the network's size.
#[derive(Debug, Clone, Copy)]
pub struct SourcePicture<'a> {
    /// Its name, with forward slashes; no two of a run are equal.
    pub name: &'a str,
    /// Width and height in pixels, upright.
    pub size: [u32; 2],
    /// How it came to the network's size.
    pub framing: Framing,
}

/// [`SourcePicture`], or the image itself where that is not given.
pub(super) struct Source {
    pub(super) name: String,
    pub(super) size: [u32; 2],
    /// Pixels of the maps for a pixel of the picture, across and down, and the corner of what was kept of it.
    scale: [f64; 2],
    corner: [f64; 2],
}

impl Source {
    /// fx, fy, cx, cy of the picture, of the maps' intrinsics.
    pub(super) fn pinhole(&self, intrinsics: &[[f32; 3]; 3]) -> [f64; 4] {
        let [[fx, _, cx], [_, fy, cy], _] = intrinsics.map(|row| row.map(f64::from));
        let [cx, cy] = self.place([cx, cy]);
        [fx / self.scale[0], fy / self.scale[1], cx, cy]
    }

    /// Where a place in the maps is in the picture.
    pub(super) fn place(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (place[axis] + self.corner[axis]) / self.scale[axis])
    }
}

impl FrameResult<'_> {
    /// The picture that it was made of.
    pub(super) fn source(&self) -> Source {
        let Some(SourcePicture { name, size, framing }) = self.source else {
            let (name, size) = (format!("{:06}.png", self.index), [self.width, self.height]);
            return Source { name, size, scale: [1.0; 2], corner: [0.0; 2] };
        };
        let resized = [framing.resized.0, framing.resized.1];
        Source {
            name: name.to_owned(),
            size,
            scale: [0, 1].map(|axis| f64::from(resized[axis]) / f64::from(size[axis])),
            corner: [f64::from(framing.crop[0]), f64::from(framing.crop[1])],
        }
    }

    /// Checks the length of every buffer.
    pub(super) fn check(&self, export: &'static str) -> Result<(), IoError> {
        let pixels = self.width as usize * self.height as usize;
        let lengths = [
            ("depth", self.depth.len(), pixels),
            ("confidence", self.confidence.map_or(pixels, <[f32]>::len), pixels),
            ("picture", self.rgb.len(), 3 * pixels),
            ("sky", self.sky.map_or(pixels, <[bool]>::len), pixels),
            (
                "Gaussians",
                self.gaussians.map_or(0, <[f32]>::len),
                self.gaussians.map_or(0, |_| GAUSSIAN_NUMBERS * pixels),
            ),
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
