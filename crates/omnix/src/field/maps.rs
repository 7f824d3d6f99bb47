//! Where what is known of every pixel beside its part of the field lies: in memory while a run makes the field, or in its file.

use std::fmt::Debug;
use std::ops::Range;

use crate::error::OmnixError;

/// All images' maps.
#[derive(Debug)]
pub(crate) enum Maps {
    Memory(Vec<ImageMaps>),
    #[cfg_attr(not(feature = "io"), expect(dead_code, reason = "made where there are files"))]
    Saved(Box<dyn SavedMaps>),
}

/// The maps of one image.
#[derive(Debug, Default)]
pub(crate) struct ImageMaps {
    pub(crate) theta: Vec<f32>,
    pub(crate) confidence: Vec<f32>,
    /// Red, green and blue of every pixel, where the processed picture is known.
    pub(crate) colours: Option<Vec<u8>>,
}

/// The maps of all images in a file, one image after another.
pub(crate) trait SavedMaps: Debug + Send + Sync {
    /// Numbers of a map.
    fn range(&self, name: &str, pixels: Range<usize>) -> Result<Vec<f32>, OmnixError>;

    /// Numbers of listed pixels of a map, counted from `first`.
    fn rows(&self, name: &str, first: usize, pixels: &[u32]) -> Result<Vec<f32>, OmnixError>;

    /// Whether there are pictures.
    fn have_pictures(&self) -> bool;

    /// Packed colours, red + 256 green + 65536 blue.
    fn colours(&self, pixels: Range<usize>) -> Result<Vec<u32>, OmnixError>;

    /// Packed colours of listed pixels, counted from `first`.
    fn colour_rows(&self, first: usize, pixels: &[u32]) -> Result<Vec<u32>, OmnixError>;
}
