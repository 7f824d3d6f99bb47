//! A field as a source of pictures.

use omnix_geometry::Camera;

use super::{ImagePoints, Source};
use crate::error::OmnixError;
use crate::field::{Field, FieldImage, Pixels, Query};

/// What a picture shows of an image whose own picture is not known.
const GREY: [u8; 3] = [150; 3];

/// The camera of an image whose pixels have their centres at halves: the network's have them at whole numbers.
pub(super) fn centred(image: &FieldImage) -> Camera {
    let mut camera = image.camera;
    camera.intrinsics[0][2] += 0.5;
    camera.intrinsics[1][2] += 0.5;
    camera
}

impl Source for Field {
    fn size(&self) -> [usize; 2] {
        [self.shape().width, self.shape().height]
    }

    fn cameras(&self) -> Vec<Camera> {
        self.images().iter().map(centred).collect()
    }

    fn image(&self, image: usize) -> Result<ImagePoints, OmnixError> {
        let positions: Vec<[f32; 3]> = self.points(image)?.as_chunks().0.to_vec();
        let known = self.pixel_values(image, &Pixels::All)?;
        Ok(ImagePoints {
            colours: known.colours.unwrap_or_else(|| vec![GREY; positions.len()]),
            confidence: Some(known.confidence),
            moving: known.theta.iter().map(|theta| self.moves(*theta)).collect(),
            positions,
        })
    }

    fn positions(&self, image: usize, pixels: &[u32], time: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
        let width = self.shape().width as u32;
        let list = pixels.iter().map(|pixel| [pixel % width, pixel / width]).collect();
        let paths = self.paths(&Query::new(image, Pixels::List(list), time..time + 1))?;
        Ok(paths.positions.as_chunks().0.to_vec())
    }
}
