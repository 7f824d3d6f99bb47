//! Pictures to a clip: brought to the network's size, and where each of its pixels lies in its picture.

use omnix_data::DataError;
use omnix_io::preprocess::{Framing, OmnixPreprocess};
use omnix_io::{IoError, Picture};

use super::network::{Clip, Network, Seen};
use crate::EvalError;
use crate::depth::Part;

/// A clip, and how each of its pictures came to its size.
pub(super) struct Framed {
    pub(super) clip: Clip,
    /// Width and height of each picture as it lies on the disk.
    pub(super) sizes: Vec<[u32; 2]>,
    framings: Vec<Framing>,
}

/// A failure with a picture.
pub(super) fn picture_error(error: IoError) -> EvalError {
    DataError::from(error).into()
}

impl Framed {
    /// The frames of one video, at the size that the network takes the first of them at; each covers that size, and what lies beyond is cut off.
    ///
    /// # Errors
    /// A picture that is too narrow.
    pub(super) fn new(network: &dyn Network, pictures: &[Picture]) -> Result<Self, EvalError> {
        let sizes: Vec<[u32; 2]> = pictures.iter().map(|picture| [picture.width, picture.height]).collect();
        let size = network.size(sizes.first().copied().unwrap_or([1, 1]));
        let steps = OmnixPreprocess { width: size[0], height: size[1] };
        let framings = sizes.iter().map(|[width, height]| steps.framing(*width, *height));
        let framings = framings.collect::<Result<_, _>>().map_err(picture_error)?;
        let pictures = pictures.iter().map(|picture| steps.apply(picture));
        let pictures: Vec<Picture> = pictures.collect::<Result<_, _>>().map_err(picture_error)?;
        let times = (0..pictures.len() as u32).map(|frame| (0, frame)).collect();
        Ok(Self { clip: Clip { size, pictures, times }, sizes, framings })
    }

    /// Which part of a map of the whole picture the network saw.
    pub(super) fn part(&self, image: usize) -> Part {
        let Framing { resized, crop } = self.framings[image];
        Part { whole: [resized.0, resized.1].map(|side| side as usize), start: [crop[0], crop[1]].map(|v| v as usize) }
    }

    /// The pixel of the clip at a place of its picture (column and row, in pixels and fractions); none where that was cut off.
    pub(super) fn pixel(&self, image: usize, [u, v]: [f64; 2]) -> Option<[u32; 2]> {
        let Part { whole, start } = self.part(image);
        let along = |place: f64, axis: usize| {
            let at = place * whole[axis] as f64 / f64::from(self.sizes[image][axis]) - start[axis] as f64;
            (at >= 0.0 && at < f64::from(self.clip.size[axis])).then_some(at as u32)
        };
        Some([along(u, 0)?, along(v, 1)?])
    }
}

/// Runs the network, and holds it to the sizes of its clip.
pub(super) fn see(network: &mut dyn Network, clip: &Clip) -> Result<Seen, EvalError> {
    let seen = network.see(clip)?;
    let (count, pixels) = (clip.pictures.len(), clip.size[0] as usize * clip.size[1] as usize);
    EvalError::expect("depths of a clip, [T][H][W]", seen.depth.len(), count * pixels)?;
    // Monocular networks make none.
    if !seen.cameras.is_empty() {
        EvalError::expect("cameras of a clip, [T]", seen.cameras.len(), count)?;
    }
    Ok(seen)
}
