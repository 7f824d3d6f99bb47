//! Which images are in which window.

use std::ops::Range;

use crate::error::OmnixError;

/// A run of images that are reconstructed together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// Its images, as the film counts them.
    pub images: Range<usize>,
    /// The shot that it is of, from 0.
    pub shot: usize,
}

/// The windows of a film, in its order. Neighbours of one shot share images, and no image is in more than two windows but in those
/// at the end of a shot, where the last window is moved back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    images: usize,
    windows: Vec<Window>,
}

/// Where an image's results come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    /// One window.
    One(usize),
    /// This window and the next, and how far the image lies on the way from the one to the other: above 0, below 1.
    Two(usize, f64),
}

impl Layout {
    /// Windows of `size` images, of which neighbours share `overlap`, over `images` images that are cut before each image in `cuts`
    /// (ascending).
    ///
    /// # Errors
    /// [`OmnixError::Request`] for windows of fewer than 2 images, or that share none or more than half of their images.
    pub fn new(images: usize, size: usize, overlap: usize, cuts: &[usize]) -> Result<Self, OmnixError> {
        Self::check(size, overlap)?;
        let mut windows = Vec::new();
        let ends = cuts.iter().copied().filter(|cut| (1..images).contains(cut)).chain([images]);
        let mut begin = 0;
        for (shot, end) in ends.enumerate() {
            let mut first = begin;
            while first + size < end {
                windows.push(Window { images: first..first + size, shot });
                first += size - overlap;
            }
            let first = begin.max(end.saturating_sub(size));
            windows.push(Window { images: first..end, shot });
            begin = end;
        }
        Ok(Self { images, windows })
    }

    /// Windows that were made before; none if these could not have been.
    pub(super) fn of(windows: Vec<Window>) -> Option<Self> {
        let (first, last) = (windows.first()?, windows.last()?);
        let follows = |pair: &[Window]| {
            let [before, after] = [0, 1].map(|i| &pair[i].images);
            let touch = if pair[0].shot == pair[1].shot {
                after.start > before.start && after.start < before.end && after.end > before.end
            } else {
                after.start == before.end
            };
            touch && !after.is_empty()
        };
        let sound = first.images.start == 0 && !first.images.is_empty() && windows.windows(2).all(follows);
        sound.then_some(Self { images: last.images.end, windows })
    }

    /// Whether windows of this size and overlap can be joined.
    ///
    /// # Errors
    /// As [`Layout::new`].
    pub fn check(size: usize, overlap: usize) -> Result<(), OmnixError> {
        let wrong = |reason: String| Err(OmnixError::Request { reason });
        match (size, overlap) {
            (..2, _) => {
                wrong(format!("a window of {size} image(s): it takes at least 2, of which neighbours share one"))
            }
            (_, 0) => {
                wrong("windows that share no images cannot be joined: let neighbours share at least one".to_owned())
            }
            _ if overlap > size / 2 => wrong(format!(
                "windows of {size} images of which neighbours share {overlap}: they may share at most half, {}",
                size / 2
            )),
            _ => Ok(()),
        }
    }

    /// Images of the film.
    #[must_use]
    pub fn images(&self) -> usize {
        self.images
    }

    /// The windows, in the film's order.
    #[must_use]
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// The images that window `k` and the next share and that come from these two; none at the end of a shot.
    #[must_use]
    pub fn shared(&self, k: usize) -> Range<usize> {
        let Some((window, next)) = self.windows.get(k).zip(self.windows.get(k + 1)) else { return 0..0 };
        let end = window.images.end;
        if window.shot != next.shot {
            return end..end;
        }
        // The last window of a shot may reach back over the one before its neighbour.
        let before = k.checked_sub(1).map(|k| &self.windows[k]).filter(|before| before.shot == window.shot);
        before.map_or(next.images.start, |before| next.images.start.max(before.images.end))..end
    }

    /// Where image `image` comes from.
    pub(super) fn source(&self, image: usize) -> Source {
        let k = self.windows.partition_point(|window| window.images.end <= image);
        let shared = self.shared(k);
        if shared.contains(&image) {
            Source::Two(k, (image - shared.start + 1) as f64 / (shared.len() + 1) as f64)
        } else {
            Source::One(k)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(images: usize, size: usize, overlap: usize, cuts: &[usize]) -> Vec<Range<usize>> {
        let layout = Layout::new(images, size, overlap, cuts).unwrap();
        layout.windows().iter().map(|window| window.images.clone()).collect()
    }

    /// One window of all images.
    fn one(images: usize) -> Vec<Range<usize>> {
        std::iter::once(0..images).collect()
    }

    #[test]
    fn windows_cover_every_image() {
        assert_eq!(ranges(10, 4, 1, &[]), [0..4, 3..7, 6..10]);
        // The last is moved back, over the one before its neighbour.
        assert_eq!(ranges(11, 4, 1, &[]), [0..4, 3..7, 6..10, 7..11]);
        assert_eq!(ranges(4, 4, 1, &[]), one(4), "exactly one");
        assert_eq!(ranges(1, 8, 2, &[]), one(1), "a film of one frame");
        assert_eq!(ranges(5, 300, 150, &[]), one(5), "a window larger than the film");
        assert_eq!(ranges(12, 6, 2, &[5]), [0..5, 5..11, 6..12]);
        assert_eq!(ranges(30, 100, 2, &[10, 20]), [0..10, 10..20, 20..30], "cuts every ten frames");
        assert_eq!(ranges(3, 4, 1, &[0, 3, 9]), one(3), "cuts outside");
    }

    #[test]
    fn every_image_has_one_source_and_fades_in_order() {
        for (images, size, overlap) in [(11, 4, 1), (11, 4, 2), (37, 8, 3), (300, 24, 12), (23, 10, 5), (9, 2, 1)] {
            let layout = Layout::new(images, size, overlap, &[]).unwrap();
            let mut before = 0.0;
            for image in 0..images {
                // How far along the windows it lies: k, or between k and k + 1.
                let along = match layout.source(image) {
                    Source::One(k) => {
                        assert!(layout.windows()[k].images.contains(&image));
                        k as f64
                    }
                    Source::Two(k, part) => {
                        assert!(part > 0.0 && part < 1.0);
                        assert!(layout.windows()[k..k + 2].iter().all(|window| window.images.contains(&image)));
                        k as f64 + part
                    }
                };
                assert!(along >= before, "{images} {size} {overlap}: image {image}");
                before = along;
            }
            for k in 0..layout.windows().len() - 1 {
                assert!(layout.shared(k).len() >= overlap, "{images} {size} {overlap}: windows {k} and {}", k + 1);
            }
        }
    }

    #[test]
    fn windows_that_cannot_be_joined_are_refused() {
        for (size, overlap, words) in [(1, 1, "at least 2"), (8, 0, "share no images"), (8, 5, "at most half, 4")] {
            let error = Layout::new(20, size, overlap, &[]).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
