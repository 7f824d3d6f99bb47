//! The field of a film in windows as a source of pictures.

use omnix_geometry::Camera;

use super::field::centred;
use super::{ImagePoints, Source};
use crate::error::OmnixError;
use crate::field::Pixels;
use crate::windows::FilmField;

impl Source for FilmField {
    fn size(&self) -> [usize; 2] {
        let [height, width] = self.size();
        [width, height]
    }

    fn cameras(&self) -> Vec<Camera> {
        self.images().iter().map(centred).collect()
    }

    fn image(&self, image: usize) -> Result<ImagePoints, OmnixError> {
        let known = self.pixel_values(image, &Pixels::All)?;
        Ok(ImagePoints {
            positions: self.points(image)?,
            colours: known.colours.unwrap_or_default(),
            confidence: Some(known.confidence),
            moving: known.theta.iter().map(|theta| self.moves(*theta)).collect(),
        })
    }

    fn positions(&self, image: usize, pixels: &[u32], time: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
        let width = self.size()[1] as u32;
        let list = pixels.iter().map(|pixel| [pixel % width, pixel / width]).collect();
        let (_, positions) = self.paths(image, &Pixels::List(list), &[time], &mut || Ok(()))?;
        Ok(positions.as_chunks().0.to_vec())
    }
}
