//! 8-bit RGB pictures and how files become one.
//!
//! Conversion as Pillow's `convert("RGB")`: alpha is dropped, not blended; palettes and grey are expanded; of 16-bit samples
//! the high byte is kept (so does Pillow for colour; its 16-bit grey saturates at 255, which would leave most such pictures
//! white). Turned upright as EXIF says; no colour management. JPEG samples differ from libjpeg-turbo's by a few levels at edges (0.3 on
//! average at most, on photographs), because decoders may round and upsample as they like.

use std::{fs, io::Cursor, path::Path};

use image::{DynamicImage, ImageError, ImageReader, Limits, RgbImage, error::DecodingError};

use super::{
    header::{self, Header},
    jpeg::{self, Fault},
};
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

/// Reads one picture file, upright.
///
/// # Errors
/// A missing or unreadable file, content that is no picture, a file that ends too early, a picture the decoder refuses or that
/// would take more than 1 GiB to decode.
pub fn load_picture(path: &Path) -> Result<Picture, IoError> {
    load_within(path, MOST)
}

/// Bytes that decoding takes at most.
const MOST: u64 = 1 << 30;

/// Reads one picture file if that takes no more than `most` bytes by its header.
pub(super) fn load_within(path: &Path, most: u64) -> Result<Picture, IoError> {
    let (decoded, header) = decoded(path, most)?;
    let (width, height) = (decoded.width(), decoded.height());
    let rgb = to_rgb8(decoded);
    let Some(rgb) = RgbImage::from_raw(width, height, rgb) else {
        return Err(IoError::ImageDecode {
            reason: "BUG: its samples do not fit its size".into(),
            path: path.to_owned(),
        });
    };
    let mut upright = DynamicImage::ImageRgb8(rgb);
    upright.apply_orientation(header.orientation);
    let (width, height) = (upright.width(), upright.height());
    Ok(Picture::new(width, height, upright.into_rgb8().into_raw()))
}

/// Width, height and a yes or no for each pixel.
type Bits = (u32, u32, Vec<bool>);

/// Which pixels of a picture are not black, upright: of 16-bit samples all bits count, and transparency does not.
pub(crate) fn not_black(path: &Path) -> Result<Bits, IoError> {
    let (mut decoded, header) = decoded(path, MOST)?;
    decoded.apply_orientation(header.orientation);
    let (width, height) = (decoded.width(), decoded.height());
    let data = match decoded {
        DynamicImage::ImageLuma16(i) => i.pixels().map(|p| p.0[0] != 0).collect(),
        DynamicImage::ImageLumaA16(i) => i.pixels().map(|p| p.0[0] != 0).collect(),
        DynamicImage::ImageRgb16(i) => i.pixels().map(|p| p.0 != [0; 3]).collect(),
        DynamicImage::ImageRgba16(i) => i.pixels().map(|p| p.0[..3] != [0; 3]).collect(),
        other => other.into_rgb8().pixels().map(|p| p.0 != [0; 3]).collect(),
    };
    Ok((width, height, data))
}

/// Which pixels of a picture are at least half opaque, upright; none where it has no alpha channel.
pub(crate) fn opaque(path: &Path) -> Result<Option<Bits>, IoError> {
    let (mut decoded, header) = decoded(path, MOST)?;
    if !decoded.color().has_alpha() {
        return Ok(None);
    }
    decoded.apply_orientation(header.orientation);
    let rgba = decoded.into_rgba8();
    Ok(Some((rgba.width(), rgba.height(), rgba.pixels().map(|p| p.0[3] >= 128).collect())))
}

/// Decodes one picture file if that takes no more than `most` bytes by its header; not yet upright.
fn decoded(path: &Path, most: u64) -> Result<(DynamicImage, Header), IoError> {
    // The header walk gives the better message for files that are no pictures at all.
    let header = header::header(path)?;
    if header.bytes > most {
        let Header { width, height, bytes: needed, .. } = header;
        return Err(IoError::PictureTooLarge { width, height, needed, most, path: path.to_owned() });
    }
    let bytes = fs::read(path).map_err(|e| IoError::read(path, e))?;
    // The walk and the decoder go over the same bytes; neither waits for the other.
    let (fault, decoded) = rayon::join(|| fault(&bytes), || decode(&bytes, most));
    match fault {
        Some(Fault::Missing(detail)) => return Err(IoError::TruncatedImage { detail, path: path.to_owned() }),
        Some(Fault::Damaged(reason)) => return Err(IoError::ImageDamaged { reason, path: path.to_owned() }),
        None => {}
    }
    let decoded = decoded.map_err(|error| match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            IoError::TruncatedImage { detail: e.to_string(), path: path.to_owned() }
        }
        ImageError::Decoding(e) if ends_early(&e) => {
            IoError::TruncatedImage { detail: e.to_string(), path: path.to_owned() }
        }
        other => IoError::ImageDecode { reason: other.to_string(), path: path.to_owned() },
    })?;
    Ok((decoded, header))
}

/// Decodes within `most` bytes.
fn decode(bytes: &[u8], most: u64) -> Result<DynamicImage, ImageError> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(most);
    reader.limits(limits);
    reader.decode()
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

/// What is wrong with a file that its decoder would not say: JPEG's fills what is missing with grey, WebP's speaks of damage where
/// the end is missing.
fn fault(bytes: &[u8]) -> Option<Fault> {
    if bytes.starts_with(&[0xff, 0xd8]) {
        return jpeg::fault(bytes);
    }
    if bytes.starts_with(b"RIFF") && bytes.len() >= 8 {
        let stated = 8 + u64::from(u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]));
        let found = bytes.len() as u64;
        return (found < stated).then(|| Fault::Missing(format!("{found} of {stated} bytes are there")));
    }
    None
}
