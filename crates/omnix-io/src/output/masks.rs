//! `masks`: which pixels move. `masks/NNNNNN.png`: 8-bit grey, 255 where the gate lets the pixel move, else 0.
//! `theta/NNNNNN.png`: 16-bit grey motion score, `round(65535 θ)` of θ clamped to 0..1; NaN becomes 0. NNNNNN is the global index.

use std::path::{Path, PathBuf};

use image::ExtendedColorType;

use super::{
    atomic, depth,
    format::{FileKind, Format, ImageWriter},
    motion::{MotionView, SourceMotion},
};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "masks",
    needs_cameras: true,
    needs_motion: true,
    files: &[
        FileKind::of_images("masks/NNNNNN.png", "8-bit grey: 255 where the pixel moves"),
        FileKind::of_images("theta/NNNNNN.png", "16-bit grey: motion score, 65535 = 1"),
    ],
    disk: |size| size.all().saturating_mul(3),
    images: Some(ImageWriter { write, wants_trajectory: |_| false }),
    ..Format::NONE
};

/// Writes both pictures of one image.
fn write(dir: &Path, views: &[MotionView], image: &SourceMotion<'_>) -> Result<Vec<PathBuf>, IoError> {
    image.check(views, FORMAT.name)?;
    image.need_all_pixels(views, FORMAT.name)?;
    let size = (views[image.index].picture.width, views[image.index].picture.height);
    let mask: Vec<u8> = image.moving.iter().map(|&m| if m { 255 } else { 0 }).collect();
    let theta: Vec<u16> = image.motion.iter().map(|&v| score16(v)).collect();
    let save = |folder: &str, bytes: &[u8], colour| {
        let path = dir.join(format!("{folder}/{:06}.png", image.index));
        let png = depth::encode(&path, bytes, size, colour)?;
        atomic::write_file(path, &png)
    };
    Ok(vec![
        save("masks", &mask, ExtendedColorType::L8)?,
        save("theta", bytemuck::cast_slice(&theta), ExtendedColorType::L16)?,
    ])
}

fn score16(score: f32) -> u16 {
    // `as` sends NaN to 0 and saturates.
    (f64::from(score).clamp(0.0, 1.0) * 65535.0).round() as u16
}

#[cfg(test)]
mod tests {
    use super::score16;

    #[test]
    fn scores_fill_the_range() {
        let scores = [0.0, 1.0, 1.000_001, -0.1, f32::NAN, 0.5].map(score16);
        assert_eq!(scores, [0, 65535, 65535, 0, 0, 32768]);
    }
}
