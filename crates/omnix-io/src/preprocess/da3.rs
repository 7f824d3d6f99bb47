//! Depth Anything 3's preprocessing: bound one side, then go to multiples of 14 (`da3.md` section 3).
//!
//! 1. The longest (upper) or shortest (lower) side becomes `process_res`; sizes round half to even; area filter when shrinking,
//!    cubic when growing; 8-bit result.
//! 2. `resize`: each side goes to the nearest multiple of 14, ties up, by a second 8-bit resampling. `crop`: each side is cut
//!    down to a multiple of 14 around the centre.
//!
//! Intrinsics follow. One difference from the reference: a side that would round to no patch becomes one patch (14 pixels)
//! instead of one pixel, which the network could not take.

use std::str::FromStr;

use super::{
    PATCH,
    framing::Framing,
    opencv::{resize_area, resize_cubic},
};
use crate::{IoError, Picture};

/// More pixels than this are a mistake, not a picture: 64 million, 192 MB as 8-bit RGB.
const MAX_PIXELS: u64 = 1 << 26;

/// Which side is bounded, and how multiples of 14 are reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ResizeMethod {
    /// Longest side to `process_res`, then resize. The reference's default.
    #[default]
    UpperBoundResize,
    /// Longest side to `process_res`, then crop.
    UpperBoundCrop,
    /// Shortest side to `process_res`, then resize.
    LowerBoundResize,
    /// Shortest side to `process_res`, then crop.
    LowerBoundCrop,
}

impl ResizeMethod {
    /// The reference's name of the method.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UpperBoundResize => "upper_bound_resize",
            Self::UpperBoundCrop => "upper_bound_crop",
            Self::LowerBoundResize => "lower_bound_resize",
            Self::LowerBoundCrop => "lower_bound_crop",
        }
    }

    fn upper(self) -> bool {
        matches!(self, Self::UpperBoundResize | Self::UpperBoundCrop)
    }

    fn crops(self) -> bool {
        matches!(self, Self::UpperBoundCrop | Self::LowerBoundCrop)
    }
}

impl FromStr for ResizeMethod {
    type Err = IoError;

    fn from_str(name: &str) -> Result<Self, IoError> {
        [Self::UpperBoundResize, Self::UpperBoundCrop, Self::LowerBoundResize, Self::LowerBoundCrop]
            .into_iter()
            .find(|m| m.name() == name)
            .ok_or_else(|| IoError::UnknownName {
                what: "resize method",
                name: name.to_owned(),
                known: "upper_bound_resize, upper_bound_crop, lower_bound_resize, lower_bound_crop",
            })
    }
}

/// Settings of the preprocessing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Da3Preprocess {
    /// Bound of the chosen side in pixels.
    pub process_res: u32,
    /// Which side, and how.
    pub method: ResizeMethod,
}

impl Default for Da3Preprocess {
    fn default() -> Self {
        Self { process_res: 504, method: ResizeMethod::default() }
    }
}

/// A picture ready to be normalised.
#[derive(Debug, Clone, PartialEq)]
pub struct Processed {
    /// 8-bit RGB, sides multiples of 14.
    pub picture: Picture,
    /// Intrinsics in the processed picture's pixels, when they were given.
    pub intrinsics: Option<[[f32; 3]; 3]>,
}

/// The sizes a picture passes through.
struct Steps {
    bounded: (u32, u32),
    last: (u32, u32),
}

impl Da3Preprocess {
    /// Size of the processed picture, known without decoding it.
    ///
    /// # Errors
    /// A size that would be nothing or beyond 64 million pixels on the way.
    pub fn output_size(&self, width: u32, height: u32) -> Result<(u32, u32), IoError> {
        self.steps(width, height).map(|s| s.last)
    }

    /// How a picture of this size comes to `common`, the size that a batch is cropped to ([`common_size`]).
    ///
    /// # Errors
    /// As [`Da3Preprocess::output_size`].
    pub fn framing(&self, width: u32, height: u32, common: (u32, u32)) -> Result<Framing, IoError> {
        let steps = self.steps(width, height)?;
        let one = if self.method.crops() {
            Framing::whole(steps.bounded).centre(steps.last)
        } else {
            Framing::whole(steps.last)
        };
        Ok(one.centre(common))
    }

    /// Resamples or crops one picture; `intrinsics` are in its pixels.
    ///
    /// # Errors
    /// As [`Da3Preprocess::output_size`].
    pub fn apply(&self, picture: &Picture, intrinsics: Option<[[f32; 3]; 3]>) -> Result<Processed, IoError> {
        let steps = self.steps(picture.width, picture.height)?;
        let mut k = intrinsics;
        let bounded;
        let mut current = picture;
        if steps.bounded != (picture.width, picture.height) {
            bounded = resample(picture, steps.bounded, &mut k);
            current = &bounded;
        }
        let picture = if steps.last == steps.bounded {
            current.clone()
        } else if self.method.crops() {
            crop_to(current, steps.last, &mut k)
        } else {
            resample(current, steps.last, &mut k)
        };
        Ok(Processed { picture, intrinsics: k })
    }

    fn steps(&self, width: u32, height: u32) -> Result<Steps, IoError> {
        let refuse =
            |becomes: String, cure: &str| IoError::DegenerateSize { width, height, becomes, cure: cure.to_owned() };
        if width == 0 || height == 0 || self.process_res == 0 {
            return Err(refuse("nothing".into(), "use a picture with pixels and a process_res above 0"));
        }
        let side = if self.method.upper() { width.max(height) } else { width.min(height) };
        let bounded = if side == self.process_res {
            (width, height)
        } else {
            let scale = f64::from(self.process_res) / f64::from(side);
            let scaled = |v: u32| ((f64::from(v) * scale).round_ties_even()).max(1.0) as u32;
            (scaled(width), scaled(height))
        };
        let too_large = |(w, h): (u32, u32)| u64::from(w) * u64::from(h) > MAX_PIXELS;
        let patches =
            |v: u32| if self.method.crops() { v / PATCH } else { ((v.saturating_add(PATCH / 2)) / PATCH).max(1) };
        let last = (patches(bounded.0) * PATCH, patches(bounded.1) * PATCH);
        if too_large(bounded) || too_large(last) {
            let becomes = format!("{} x {}", last.0, last.1);
            return Err(refuse(becomes, "use an upper_bound method or a smaller process_res"));
        }
        if last.0 == 0 || last.1 == 0 {
            let becomes = format!("{} x {}, less than one patch of 14 pixels", bounded.0, bounded.1);
            return Err(refuse(becomes, "use a resize method instead of a crop, or a larger process_res"));
        }
        Ok(Steps { bounded, last })
    }
}

/// Resamples to `size`: cubic if a side grows, else area.
fn resample(picture: &Picture, size: (u32, u32), k: &mut Option<[[f32; 3]; 3]>) -> Picture {
    let (w, h) = size;
    if let Some(k) = k {
        let (sx, sy) = (w as f32 / picture.width as f32, h as f32 / picture.height as f32);
        k[0].iter_mut().for_each(|v| *v *= sx);
        k[1].iter_mut().for_each(|v| *v *= sy);
    }
    if w > picture.width || h > picture.height { resize_cubic(picture, w, h) } else { resize_area(picture, w, h) }
}

fn crop_to(picture: &Picture, (w, h): (u32, u32), k: &mut Option<[[f32; 3]; 3]>) -> Picture {
    let (left, top) = ((picture.width - w) / 2, (picture.height - h) / 2);
    if let Some(k) = k {
        k[0][2] -= left as f32;
        k[1][2] -= top as f32;
    }
    picture.crop(left, top, w, h)
}

/// The size that a batch of different sizes is cropped to: the smallest width and the smallest height. None for no pictures.
#[must_use]
pub fn common_size(sizes: impl IntoIterator<Item = (u32, u32)>) -> Option<(u32, u32)> {
    sizes.into_iter().reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
}

/// Centre crop to a batch's [`common_size`]; intrinsics follow.
///
/// # Panics
/// When the size is larger than the picture: a fault of the caller.
#[must_use]
pub fn centre_crop(processed: Processed, size: (u32, u32)) -> Processed {
    if (processed.picture.width, processed.picture.height) == size {
        return processed;
    }
    let mut k = processed.intrinsics;
    let picture = crop_to(&processed.picture, size, &mut k);
    Processed { picture, intrinsics: k }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_the_specification() {
        let size = |w, h| Da3Preprocess::default().output_size(w, h).unwrap();
        assert_eq!(size(1208, 680), (504, 280));
        assert_eq!(size(1920, 1080), (504, 280));
        assert_eq!(size(640, 480), (504, 378));
        assert_eq!(size(504, 63), (504, 70), "ties go up");
    }

    #[test]
    fn narrow_pictures_get_one_patch_or_an_error() {
        let with = |method| Da3Preprocess { process_res: 504, method };
        assert_eq!(with(ResizeMethod::UpperBoundResize).output_size(3, 1000).unwrap(), (14, 504));
        assert_eq!(with(ResizeMethod::UpperBoundResize).output_size(3, 3).unwrap(), (504, 504));
        assert!(with(ResizeMethod::UpperBoundCrop).output_size(3, 1000).is_err());
        assert!(with(ResizeMethod::LowerBoundResize).output_size(3, 100_000).is_err());
    }
}
