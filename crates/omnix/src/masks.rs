//! What is said of pixels before a run: which to ignore, which stand still, which move.
//!
//! An ignored pixel has depth 0 and confidence 0 in the results, its sky counts for no other pixel, and its path is nowhere. What stands still
//! or moves is decided before the field exists: the cells of such pixels are followed first or last, and the pixels read the field where
//! its motion score is 0 or that of a cell that is followed. So results, the saved field and every query of it say the same.

use omnix_model::PATCH;

use crate::error::OmnixError;

/// What is said of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelMark {
    /// Nothing.
    #[default]
    None,
    /// It takes no part, and leaves no point.
    Ignored,
    /// It stands still, whatever the network says.
    Still,
    /// It moves as the network says of its cell, or of the nearest cell that is followed.
    Moving,
}

/// Marks of all pixels of all images, in runs of equal ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Masks {
    images: Vec<Vec<(u32, PixelMark)>>,
}

impl Masks {
    /// No images yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The marks of the next image, row by row.
    pub fn push(&mut self, marks: impl IntoIterator<Item = PixelMark>) {
        let mut runs: Vec<(u32, PixelMark)> = Vec::new();
        for mark in marks {
            match runs.last_mut() {
                Some((count, last)) if *last == mark => *count += 1,
                _ => runs.push((1, mark)),
            }
        }
        self.images.push(runs);
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether there are no images.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// The marks of an image, row by row.
    pub fn image(&self, image: usize) -> impl Iterator<Item = PixelMark> + Clone + '_ {
        self.images[image].iter().flat_map(|(count, mark)| std::iter::repeat_n(*mark, *count as usize))
    }

    /// Pixels of all images with this mark.
    #[must_use]
    pub fn count(&self, mark: PixelMark) -> u64 {
        self.images.iter().flatten().filter(|(_, of)| *of == mark).map(|(count, _)| u64::from(*count)).sum()
    }

    /// Whether anything is said of any pixel.
    #[must_use]
    pub fn any(&self) -> bool {
        self.images.iter().flatten().any(|(_, mark)| *mark != PixelMark::None)
    }

    /// The marks of these images.
    #[must_use]
    pub fn part(&self, images: std::ops::Range<usize>) -> Self {
        Self { images: self.images[images].to_vec() }
    }

    /// A digest of all marks.
    #[cfg(feature = "io")]
    #[must_use]
    pub fn digest(&self) -> String {
        let mut digest = blake3::Hasher::new();
        for runs in &self.images {
            digest.update(&(runs.len() as u64).to_le_bytes());
            for (count, mark) in runs {
                digest.update(&count.to_le_bytes());
                digest.update(&[*mark as u8]);
            }
        }
        format!("blake3:{}", digest.finalize().to_hex())
    }

    /// Checks that there are `images` images of this many pixels.
    pub(crate) fn check(&self, images: usize, pixels: usize) -> Result<(), OmnixError> {
        let wrong = |reason: String| Err(OmnixError::Request { reason });
        if self.len() != images {
            return wrong(format!("masks of {} images for {images} images", self.len()));
        }
        let counts = self.images.iter().map(|runs| runs.iter().map(|(count, _)| *count as usize).sum::<usize>());
        match counts.enumerate().find(|(_, count)| *count != pixels) {
            Some((image, count)) => wrong(format!("the mask of image {image} has {count} pixels, the image {pixels}")),
            None => Ok(()),
        }
    }

    /// What is said of an image's cells, of `grid` rows and columns, by their pixels: 1 for a cell with a pixel that moves, 0 for one whose
    /// pixels all stand still or are ignored, none for others.
    pub(crate) fn cells(&self, image: usize, [rows, columns]: [usize; 2]) -> Vec<Option<f32>> {
        let mut moves = vec![false; rows * columns];
        let mut open = vec![false; rows * columns];
        for (pixel, mark) in self.image(image).enumerate() {
            let cell = cell_of(pixel, columns);
            moves[cell] |= mark == PixelMark::Moving;
            open[cell] |= mark == PixelMark::None;
        }
        (0..rows * columns)
            .map(|cell| match (moves[cell], open[cell]) {
                (true, _) => Some(1.0),
                (false, false) => Some(0.0),
                (false, true) => None,
            })
            .collect()
    }
}

/// The cell of a pixel, in a grid of this many columns.
pub(crate) fn cell_of(pixel: usize, columns: usize) -> usize {
    let width = columns * PATCH;
    (pixel / width / PATCH) * columns + pixel % width / PATCH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_come_back_and_cells_follow_their_pixels() {
        // Two cells beside each other: one still but for an ignored pixel, one with a single pixel that moves.
        let mark = |pixel: usize| match (pixel % 28 < 14, pixel) {
            (true, 0) => PixelMark::Ignored,
            (true, _) => PixelMark::Still,
            (false, 20) => PixelMark::Moving,
            (false, _) => PixelMark::None,
        };
        let mut masks = Masks::new();
        masks.push((0..28 * 14).map(mark));
        masks.push(std::iter::repeat_n(PixelMark::None, 28 * 14));
        assert!(masks.image(0).eq((0..28 * 14).map(mark)) && masks.any());
        assert_eq!(masks.cells(0, [1, 2]), [Some(0.0), Some(1.0)]);
        assert_eq!(masks.cells(1, [1, 2]), [None, None]);
        assert_eq!(masks.count(PixelMark::Ignored), 1);
        assert!(!masks.part(1..2).any() && masks.part(1..2).len() == 1);
        assert!(masks.check(2, 28 * 14).is_ok() && masks.check(3, 28 * 14).is_err() && masks.check(2, 9).is_err());
    }
}
