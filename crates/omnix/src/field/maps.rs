//! Where what is known of every pixel beside its part of the field lies: in memory while a run makes the field, or in its file.

use std::sync::Arc;

use omnix_io::Picture;
use omnix_io::output::field::FieldReader;

/// All images' maps.
#[derive(Debug)]
pub(crate) enum Maps {
    Memory(Vec<ImageMaps>),
    Saved { file: Arc<FieldReader>, pictures: bool },
}

/// The maps of one image.
#[derive(Debug, Default)]
pub(crate) struct ImageMaps {
    pub(crate) theta: Vec<f32>,
    pub(crate) confidence: Vec<f32>,
    pub(crate) picture: Option<Picture>,
}

impl Maps {
    /// Whether the pictures of all images are known.
    pub(crate) fn have_pictures(&self) -> bool {
        match self {
            Self::Memory(images) => images.iter().all(|image| image.picture.is_some()),
            Self::Saved { pictures, .. } => *pictures,
        }
    }
}
