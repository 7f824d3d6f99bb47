//! The processed pictures of a field's images, for exports with colours.

use omnix_io::Picture;

use super::Field;
use super::maps::Maps;
use crate::error::OmnixError;

impl Field {
    /// The processed picture of an image, for exports with colours, where it is known.
    ///
    /// # Errors
    /// As [`Field::theta`].
    pub fn picture(&self, image: usize) -> Result<Option<Picture>, OmnixError> {
        let (width, height) = (self.shape().width as u32, self.shape().height as u32);
        self.check_image(image)?;
        Ok(self.colours(image, None)?.map(|colours| Picture::new(width, height, colours.into_flattened())))
    }

    /// Whether the pictures of all images are known.
    pub(super) fn have_pictures(&self) -> bool {
        match &self.maps {
            Maps::Memory(images) => images.iter().all(|image| image.colours.is_some()),
            Maps::Saved(file) => file.have_pictures(),
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
            Maps::Memory(images) => images[image].colours = Some(picture.data),
            Maps::Saved(_) => {
                let reason = "the pictures of a saved field are those in its file".to_owned();
                return Err(OmnixError::Query { reason });
            }
        }
        Ok(())
    }
}
