//! 8-bit RGB pictures and how files become one.
//!
//! Conversion as Pillow's `convert("RGB")`: alpha is dropped, not blended; palettes and grey are expanded; of 16-bit samples
//! the high byte is kept (so does Pillow for colour; its 16-bit grey saturates at 255, which would leave most such pictures
//! white). No EXIF rotation, no colour management. JPEG samples differ from libjpeg-turbo's by a few levels at edges (0.3 on
//! average at most, on photographs), because decoders may round and upsample as they like.

use std::{fs, io::Cursor, path::Path};

use image::{DynamicImage, ImageError, ImageReader, error::DecodingError};

use super::header;
use crate::IoError;

/// A picture, 8-bit RGB, rows from the top, `data[(y * width + x) * 3 + channel]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// `width * height * 3` bytes.
    pub data: Vec<u8>,
}

impl Picture {
    /// A picture from its bytes.
    ///
    /// # Panics
    /// When `data` does not hold `width * height * 3` bytes, or a side is 0: a fault of the caller.
    #[must_use]
    pub fn new(width: u32, height: u32, data: Vec<u8>) -> Self {
        assert!(
            width > 0 && height > 0 && data.len() == width as usize * height as usize * 3,
            "BUG: {} bytes for a picture of {width} x {height}",
            data.len()
        );
        Self { width, height, data }
    }

    /// The part of `width` x `height` pixels whose top left corner is at (`left`, `top`); it must lie inside.
    #[must_use]
    pub fn crop(&self, left: u32, top: u32, width: u32, height: u32) -> Self {
        assert!(
            left + width <= self.width && top + height <= self.height,
            "BUG: crop {width} x {height} at {left},{top} of {} x {}",
            self.width,
            self.height
        );
        let mut data = Vec::with_capacity(width as usize * height as usize * 3);
        for y in top..top + height {
            let start = (y as usize * self.width as usize + left as usize) * 3;
            data.extend_from_slice(&self.data[start..start + width as usize * 3]);
        }
        Self::new(width, height, data)
    }
}

/// Reads one picture file.
///
/// # Errors
/// A missing or unreadable file, content that is no picture, a file that ends too early, a picture the decoder refuses.
pub fn load_picture(path: &Path) -> Result<Picture, IoError> {
    // The header walk gives the better message for files that are no pictures at all.
    header::image_size(path)?;
    let bytes = fs::read(path).map_err(|e| IoError::read(path, e))?;
    if let Some(detail) = missing_end(&bytes) {
        return Err(IoError::TruncatedImage { detail, path: path.to_owned() });
    }
    let decode = |reason: String| IoError::ImageDecode { reason, path: path.to_owned() };
    let reader =
        ImageReader::new(Cursor::new(bytes.as_slice())).with_guessed_format().map_err(|e| IoError::read(path, e))?;
    let image = reader.decode().map_err(|error| match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            IoError::TruncatedImage { detail: e.to_string(), path: path.to_owned() }
        }
        ImageError::Decoding(e) if ends_early(&e) => {
            IoError::TruncatedImage { detail: e.to_string(), path: path.to_owned() }
        }
        other => decode(other.to_string()),
    })?;
    let (width, height) = (image.width(), image.height());
    Ok(Picture::new(width, height, to_rgb8(image)))
}

/// Whether a decoder's message is about missing bytes. The crates behind `image` have no common type for it.
fn ends_early(error: &DecodingError) -> bool {
    let text = error.to_string().to_ascii_lowercase();
    [
        "unexpected end",
        "unexpectedeof",
        "eof",
        "truncated",
        "premature",
        "not enough",
        "too short",
        "failed to fill",
        "exhausted",
    ]
    .iter()
    .any(|words| text.contains(words))
}

fn to_rgb8(image: DynamicImage) -> Vec<u8> {
    let high = |v: u16| (v >> 8) as u8;
    match image {
        DynamicImage::ImageRgb8(i) => i.into_raw(),
        DynamicImage::ImageLuma16(i) => i.pixels().flat_map(|p| [high(p.0[0]); 3]).collect(),
        DynamicImage::ImageLumaA16(i) => i.pixels().flat_map(|p| [high(p.0[0]); 3]).collect(),
        DynamicImage::ImageRgb16(i) => i.into_raw().into_iter().map(high).collect(),
        DynamicImage::ImageRgba16(i) => i.pixels().flat_map(|p| [high(p.0[0]), high(p.0[1]), high(p.0[2])]).collect(),
        other => other.into_rgb8().into_raw(),
    }
}

/// What tells that a file ends too early, where its decoder would not say so: JPEG's fills the rest with grey, WebP's speaks of
/// damage.
fn missing_end(bytes: &[u8]) -> Option<String> {
    if bytes.starts_with(&[0xff, 0xd8]) && !jpeg_has_end(bytes) {
        return Some(format!("no end-of-image marker in {} bytes", bytes.len()));
    }
    if bytes.starts_with(b"RIFF") && bytes.len() >= 8 {
        let stated = 8 + u64::from(u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]));
        let found = bytes.len() as u64;
        return (found < stated).then(|| format!("{found} of {stated} bytes are there"));
    }
    None
}

/// Whether the entropy-coded part of a JPEG reaches an end-of-image marker. Thumbnails inside metadata have one of their own,
/// so the segments before the first scan are skipped.
fn jpeg_has_end(bytes: &[u8]) -> bool {
    let mut at = 2;
    while at + 4 <= bytes.len() && bytes[at] == 0xff {
        let marker = bytes[at + 1];
        let length = match marker {
            0xff => {
                at += 1;
                continue;
            }
            0xda => return bytes[at..].windows(2).rev().any(|w| w == [0xff, 0xd9]),
            0x01 | 0xd0..=0xd9 => 0,
            _ => usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]])),
        };
        at += 2 + length;
    }
    false
}
