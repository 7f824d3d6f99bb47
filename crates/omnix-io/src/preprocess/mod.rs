//! Pictures to the network's input.
//!
//! * [`Da3Preprocess`]: Depth Anything 3's two-step 8-bit resampling (`da3.md` section 3), with OpenCV's area and cubic filters.
//! * [`OmnixPreprocess`]: OmniX's resize and centre crop to a fixed size (`omnix.md` section 2), with Pillow's filters.
//! * [`normalise`]: `(x/255 - mean)/std` to planar `[3, H, W]` f32, shared by both.
//!
//! Everything before [`normalise`] is 8-bit, since both references round to 8 bits after each resampling.

mod da3;
mod framing;
mod omnix;
mod opencv;
mod pillow;

pub use da3::{Da3Preprocess, Processed, ResizeMethod, centre_crop, common_size};
pub use framing::Framing;
pub use omnix::OmnixPreprocess;
pub use opencv::{resize_area, resize_cubic};
pub use pillow::{PillowFilter, resize_pillow};

use crate::Picture;

/// Side of a patch in pixels.
pub const PATCH: u32 = 14;
/// Mean of each channel, red, green, blue, of pictures scaled to 0..1.
pub const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
/// Standard deviation of each channel.
pub const STD: [f32; 3] = [0.229, 0.224, 0.225];

/// The network's value of an 8-bit sample, in the reference's order of f32 operations.
fn normalised(value: u8, channel: usize) -> f32 {
    (f32::from(value) / 255.0 - MEAN[channel]) / STD[channel]
}

/// `(x/255 - mean)/std`, planar: `out[channel][y][x]`.
///
/// # Panics
/// When `out` does not hold `3 * height * width` numbers: a fault of the caller.
pub fn normalise(picture: &Picture, out: &mut [f32]) {
    let pixels = picture.width as usize * picture.height as usize;
    assert_eq!(out.len(), 3 * pixels, "BUG: output of normalise has the wrong length");
    for (channel, plane) in out.chunks_exact_mut(pixels).enumerate() {
        let table: Vec<f32> = (0..=255).map(|v| normalised(v, channel)).collect();
        for (to, from) in plane.iter_mut().zip(picture.data.chunks_exact(3)) {
            *to = table[usize::from(from[channel])];
        }
    }
}

/// The picture as the reference keeps it for exports: `floor(255 * clip(x*std + mean, 0, 1))` of the normalised one. Truncation,
/// so a value can come out 1 lower than it went in.
#[must_use]
pub fn exported_picture(picture: &Picture) -> Picture {
    let back = |channel: usize| {
        move |v: u8| (255.0 * (normalised(v, channel) * STD[channel] + MEAN[channel]).clamp(0.0, 1.0)) as u8
    };
    let tables: Vec<Vec<u8>> = (0..3).map(|c| (0..=255).map(back(c)).collect()).collect();
    let data = picture.data.iter().enumerate().map(|(i, &v)| tables[i % 3][usize::from(v)]).collect();
    Picture::new(picture.width, picture.height, data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn export_is_at_most_one_lower() {
        let data: Vec<u8> = (0..=255u8).flat_map(|v| [v, v, v]).collect();
        let out = exported_picture(&Picture::new(256, 1, data.clone()));
        assert!(data.iter().zip(&out.data).all(|(a, b)| a - b <= 1));
    }
}
