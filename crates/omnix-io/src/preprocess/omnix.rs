//! OmniX's preparation: cover a fixed size, then crop its centre (`omnix.md` section 2, rule 2).
//!
//! `s = max(W/w, H/h) + 1e-8`; resize to `(floor(w*s), floor(h*s))` with Pillow's Lanczos if `s < 1`, else Pillow's bicubic;
//! crop with `left = (w' - W)/2`, `top = (h' - H)/2`, both rounded half to even.

use super::{
    PATCH,
    framing::Framing,
    pillow::{PillowFilter, resize_pillow},
};
use crate::{IoError, Picture};

/// More pixels than this on the way are a mistake, not a picture.
const MAX_PIXELS: f64 = (1u64 << 26) as f64;

/// Settings of the preparation: the network's input size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OmnixPreprocess {
    /// Width in pixels, a multiple of 14.
    pub width: u32,
    /// Height in pixels, a multiple of 14.
    pub height: u32,
}

impl Default for OmnixPreprocess {
    fn default() -> Self {
        Self { width: 504, height: 280 }
    }
}

impl OmnixPreprocess {
    /// How a picture of this size comes to the fixed size.
    ///
    /// # Errors
    /// A fixed size that is not a multiple of 14; a picture so narrow that covering the size takes more than 64 million pixels.
    pub fn framing(&self, width: u32, height: u32) -> Result<Framing, IoError> {
        let (w, h) = (f64::from(width), f64::from(height));
        let refuse =
            |becomes: String, cure: &str| IoError::DegenerateSize { width, height, becomes, cure: cure.to_owned() };
        if self.width == 0
            || self.height == 0
            || !self.width.is_multiple_of(PATCH)
            || !self.height.is_multiple_of(PATCH)
        {
            return Err(refuse(format!("{} x {}", self.width, self.height), "choose sides that are multiples of 14"));
        }
        let scale = (f64::from(self.width) / w).max(f64::from(self.height) / h) + 1e-8;
        let (across, down) = ((w * scale).floor(), (h * scale).floor());
        if across * down > MAX_PIXELS {
            return Err(refuse(
                format!("{across} x {down} before the crop"),
                "crop the picture to a less extreme shape first",
            ));
        }
        // The 1e-8 keeps both sides from falling short; the lower bound is for pictures beyond its precision.
        let resized = ((across as u32).max(self.width), (down as u32).max(self.height));
        let half = |extra: u32| (f64::from(extra) / 2.0).round_ties_even() as u32;
        let (left, top) = (half(resized.0 - self.width), half(resized.1 - self.height));
        Ok(Framing { resized, crop: [left, top, self.width, self.height] })
    }

    /// Resizes and crops one picture to exactly the fixed size.
    ///
    /// # Errors
    /// As [`OmnixPreprocess::framing`].
    pub fn apply(&self, picture: &Picture) -> Result<Picture, IoError> {
        let Framing { resized: (across, down), crop: [left, top, width, height] } =
            self.framing(picture.width, picture.height)?;
        let (w, h) = (f64::from(picture.width), f64::from(picture.height));
        let shrinks = (f64::from(self.width) / w).max(f64::from(self.height) / h) + 1e-8 < 1.0;
        let filter = if shrinks { PillowFilter::Lanczos } else { PillowFilter::Bicubic };
        Ok(resize_pillow(picture, across, down, filter).crop(left, top, width, height))
    }
}
