//! What is known of every pixel beside its part of the field: motion score, confidence, colour. Of a saved field, what is asked
//! for is read from the file, and little else.

use std::borrow::Cow;

use omnix_io::Picture;

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
            Maps::Saved { file, .. } => Cow::Owned(file.read(name, image * pixels..(image + 1) * pixels)?),
        })
    }

    /// The processed picture of an image, for exports with colours, where it is known.
    ///
    /// # Errors
    /// As [`Field::theta`].
    pub fn picture(&self, image: usize) -> Result<Option<Picture>, OmnixError> {
        self.check_image(image)?;
        let shape = self.shape();
        let pixels = shape.pixels();
        match &self.maps {
            Maps::Memory(images) => Ok(images[image].picture.clone()),
            Maps::Saved { pictures: false, .. } => Ok(None),
            Maps::Saved { file, .. } => {
                let packed = file.read_u32("pictures", image * pixels..(image + 1) * pixels)?;
                let data = packed.into_iter().flat_map(rgb).collect();
                Ok(Some(Picture::new(shape.width as u32, shape.height as u32, data)))
            }
        }
    }

    /// Adds an image's processed picture, which the engine does not know.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image that is not there or a picture of another size; a saved field, which has its own.
    pub fn set_picture(&mut self, image: usize, picture: Picture) -> Result<(), OmnixError> {
        self.check_image(image)?;
        let shape = *self.shape();
        if (picture.width as usize, picture.height as usize) != (shape.width, shape.height) {
            let (w, h) = (picture.width, picture.height);
            let reason = format!("a picture of {w}x{h}: images of this field have {}x{}", shape.width, shape.height);
            return Err(OmnixError::Query { reason });
        }
        match &mut self.maps {
            Maps::Memory(images) => images[image].picture = Some(picture),
            Maps::Saved { .. } => {
                let reason = "the pictures of a saved field are those in its file".to_owned();
                return Err(OmnixError::Query { reason });
            }
        }
        Ok(())
    }

    /// Score, confidence and colour of some pixels of an image. Of a saved field little else is read.
    ///
    /// # Errors
    /// As [`Field::paths`].
    pub fn pixel_values(&self, image: usize, pixels: &Pixels) -> Result<PixelValues, OmnixError> {
        self.check_image(image)?;
        let Some(list) = pixels.resolve(self.shape())? else {
            let (theta, confidence) = (self.theta(image)?.into_owned(), self.confidence(image)?.into_owned());
            let colours = self.picture(image)?.map(|picture| picture.data.as_chunks().0.to_vec());
            return Ok(PixelValues { theta, confidence, colours });
        };
        match &self.maps {
            Maps::Memory(images) => {
                let maps = &images[image];
                let of = |map: &[f32]| list.iter().map(|p| map[*p as usize]).collect();
                let colour = |data: &[u8], p: u32| std::array::from_fn(|c| data[3 * p as usize + c]);
                let colours = maps.picture.as_ref().map(|p| list.iter().map(|at| colour(&p.data, *at)).collect());
                Ok(PixelValues { theta: of(&maps.theta), confidence: of(&maps.confidence), colours })
            }
            Maps::Saved { file, pictures } => {
                let first = image * self.shape().pixels();
                let packed = if *pictures { Some(file.rows_u32("pictures", first, 1, &list)?) } else { None };
                Ok(PixelValues {
                    theta: file.rows("theta", first, 1, &list)?,
                    confidence: file.rows("confidence", first, 1, &list)?,
                    colours: packed.map(|packed| packed.into_iter().map(rgb).collect()),
                })
            }
        }
    }
}

/// A colour from red + 256 green + 65536 blue.
fn rgb(packed: u32) -> [u8; 3] {
    let [r, g, b, _] = packed.to_le_bytes();
    [r, g, b]
}
