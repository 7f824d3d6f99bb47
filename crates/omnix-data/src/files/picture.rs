//! Pictures: colour as omnix-io reads it, and grey maps (masks, depth) with all their bits.

use std::path::Path;

use image::{DynamicImage, ImageReader, Limits};
use omnix_io::Picture;
use omnix_io::input::load_picture;

use crate::DataError;

/// A map of grey levels, rows from the top.
#[derive(Debug)]
pub(crate) struct Grey {
    /// Width and height.
    pub(crate) size: [usize; 2],
    /// As stored: 0 to 255 or, of 16 bits, 0 to 65535.
    pub(crate) values: Vec<u16>,
    /// Of 16 bits.
    pub(crate) deep: bool,
}

/// Reads a colour picture, upright, as 8-bit RGB.
pub(crate) fn read_rgb(path: &Path) -> Result<Picture, DataError> {
    if !path.exists() {
        return Err(DataError::Missing { path: path.to_owned() });
    }
    Ok(load_picture(path)?)
}

/// Reads a map of one channel. Of several, which must be equal, the first is taken; an alpha channel is dropped.
pub(crate) fn read_grey(path: &Path) -> Result<Grey, DataError> {
    let refuse = |reason: String| DataError::Map { reason, path: path.to_owned() };
    match std::fs::metadata(path) {
        Ok(meta) if meta.is_file() => {}
        Ok(_) => return Err(DataError::NotAFile { path: path.to_owned() }),
        Err(source) => return Err(DataError::read(path, source)),
    }
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|source| DataError::read(path, source))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(1 << 30);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| refuse(error.to_string()))?;
    let size = [decoded.width() as usize, decoded.height() as usize];
    let grey = |values: Vec<u16>, deep| Grey { size, values, deep };
    let first = |values: &[u8], channels: usize| -> Result<Vec<u16>, DataError> {
        let mut pixels = values.chunks_exact(channels);
        if pixels.any(|p| p[0] != p[1] || p[0] != p[2]) {
            return Err(refuse("it is a picture in colour".to_owned()));
        }
        Ok(values.chunks_exact(channels).map(|p| u16::from(p[0])).collect())
    };
    Ok(match &decoded {
        DynamicImage::ImageLuma8(i) => grey(i.as_raw().iter().map(|v| u16::from(*v)).collect(), false),
        DynamicImage::ImageLumaA8(i) => grey(i.pixels().map(|p| u16::from(p.0[0])).collect(), false),
        DynamicImage::ImageRgb8(i) => grey(first(i.as_raw(), 3)?, false),
        DynamicImage::ImageRgba8(i) => grey(first(i.as_raw(), 4)?, false),
        DynamicImage::ImageLuma16(i) => grey(i.as_raw().clone(), true),
        DynamicImage::ImageLumaA16(i) => grey(i.pixels().map(|p| p.0[0]).collect(), true),
        _ => return Err(refuse(format!("its pixels are {:?}", decoded.color()))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_kept_and_colour_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        image::ImageBuffer::from_raw(2, 1, vec![1u16, 65535])
            .map(DynamicImage::ImageLuma16)
            .unwrap()
            .save(&path)
            .unwrap();
        let map = read_grey(&path).unwrap();
        assert_eq!((map.size, map.values, map.deep), ([2, 1], vec![1, 65535], true));
        let rgb = |data: Vec<u8>| image::RgbImage::from_raw(2, 1, data).unwrap().save(&path).unwrap();
        rgb(vec![7, 7, 7, 9, 9, 9]);
        assert_eq!(read_grey(&path).unwrap().values, [7, 9]);
        rgb(vec![7, 7, 7, 9, 9, 8]);
        assert!(read_grey(&path).unwrap_err().to_string().contains("colour"));
    }
}
