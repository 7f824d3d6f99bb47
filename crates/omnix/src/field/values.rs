//! What is known of every pixel beside its part of the field: motion score, confidence, colour. Of a saved field, what is asked
//! for is read from the file, and little else.

use std::borrow::Cow;

use super::Field;
use super::maps::{ImageMaps, Maps};
use super::query::Pixels;
use crate::error::OmnixError;

/// What is known of some pixels of an image, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelValues {
    /// Motion score θ.
    pub theta: Vec<f32>,
    /// Confidence of the pixel's path, at least 1, the same at all times.
    pub confidence: Vec<f32>,
    /// Red, green and blue, where the processed picture is known.
    pub colours: Option<Vec<[u8; 3]>>,
}

impl Field {
    /// Motion score θ of every pixel of an image, row by row.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image that is not there; a failure of reading a file.
    pub fn theta(&self, image: usize) -> Result<Cow<'_, [f32]>, OmnixError> {
        self.map(image, "theta", |maps| &maps.theta)
    }

    /// Confidence of the paths of every pixel of an image, at least 1, the same at all times, row by row.
    ///
    /// # Errors
    /// As [`Field::theta`].
    pub fn confidence(&self, image: usize) -> Result<Cow<'_, [f32]>, OmnixError> {
        self.map(image, "confidence", |maps| &maps.confidence)
    }

    /// An error for an image that is not there.
    pub(super) fn check_image(&self, image: usize) -> Result<(), OmnixError> {
        let images = self.shape().images;
        if image < images {
            return Ok(());
        }
        let reason = format!("there is no image {image}: images go from 0 to {}", images - 1);
        Err(OmnixError::Query { reason })
    }

    fn map(
        &self,
        image: usize,
        name: &str,
        of: impl Fn(&ImageMaps) -> &Vec<f32>,
    ) -> Result<Cow<'_, [f32]>, OmnixError> {
        self.check_image(image)?;
        let pixels = self.shape().pixels();
        Ok(match &self.maps {
            Maps::Memory(images) => Cow::Borrowed(of(&images[image]).as_slice()),
            Maps::Saved(file) => Cow::Owned(file.range(name, image * pixels..(image + 1) * pixels)?),
        })
    }

    /// Score, confidence and colour of some pixels of an image. Of a saved field little else is read.
    ///
    /// # Errors
    /// As [`Field::paths`].
    pub fn pixel_values(&self, image: usize, pixels: &Pixels) -> Result<PixelValues, OmnixError> {
        self.check_image(image)?;
        let list = pixels.resolve(self.shape())?;
        let colours = self.colours(image, list.as_deref())?;
        let Some(list) = list else {
            let (theta, confidence) = (self.theta(image)?.into_owned(), self.confidence(image)?.into_owned());
            return Ok(PixelValues { theta, confidence, colours });
        };
        match &self.maps {
            Maps::Memory(images) => {
                let of = |map: &[f32]| list.iter().map(|p| map[*p as usize]).collect();
                let maps = &images[image];
                Ok(PixelValues { theta: of(&maps.theta), confidence: of(&maps.confidence), colours })
            }
            Maps::Saved(file) => {
                let of = |name| file.rows(name, image * self.shape().pixels(), &list);
                Ok(PixelValues { theta: of("theta")?, confidence: of("confidence")?, colours })
            }
        }
    }

    /// Colours of some pixels of an image, or of all, where its picture is known.
    pub(super) fn colours(&self, image: usize, list: Option<&[u32]>) -> Result<Option<Vec<[u8; 3]>>, OmnixError> {
        let pixels = self.shape().pixels();
        match &self.maps {
            Maps::Memory(images) => Ok(images[image].colours.as_ref().map(|data| {
                let all = data.as_chunks().0;
                list.map_or_else(|| all.to_vec(), |list| list.iter().map(|p| all[*p as usize]).collect())
            })),
            Maps::Saved(file) if file.have_pictures() => {
                let packed = match list {
                    None => file.colours(image * pixels..(image + 1) * pixels)?,
                    Some(list) => file.colour_rows(image * pixels, list)?,
                };
                Ok(Some(packed.into_iter().map(rgb).collect()))
            }
            Maps::Saved(_) => Ok(None),
        }
    }
}

/// A colour from red + 256 green + 65536 blue.
fn rgb(packed: u32) -> [u8; 3] {
    let [r, g, b, _] = packed.to_le_bytes();
    [r, g, b]
}
