//! `depth`: every image's depth as 16-bit PNG and as a coloured PNG.
//!
//! `depth/NNNNNN.png`: 16-bit grey, `value * scale = depth`, 0 = no depth. The scale is the power of two that just fits the
//! image's largest depth; it stands in the PNG itself (text chunk `omnix:depth_scale`) and in `depth/depth.json`.
//! `depth_color/NNNNNN.png`: see [`super::spectral`]; the colour range is each image's own. NNNNNN is the global index.

use std::path::{Path, PathBuf};

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use serde::Serialize;

use super::{
    atomic, colour,
    format::{FileKind, Format},
    frame::{FrameResult, RunSummary, Sink},
    options::SinkOptions,
};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "depth",
    by_default: true,
    files: &[
        FileKind::of_images(
            "depth/NNNNNN.png",
            "depth as 16-bit grey; scale in depth/depth.json and in the text chunk omnix:depth_scale",
        ),
        FileKind::of_images(
            "depth_color/NNNNNN.png",
            "inverse depth, 2nd to 98th percentile, Spectral: near red, far violet, no depth black",
        ),
        FileKind::one(
            "depth/depth.json",
            "scale and range of every depth picture: 16-bit value * scale = depth, 0 = no depth",
        ),
    ],
    disk: |size| size.all().saturating_mul(5),
    frames: Some(|dir, options| Ok(Box::new(DepthSink::new(dir, options)))),
    ..Format::NONE
};

#[derive(Serialize)]
struct Entry {
    file: String,
    color_file: String,
    index: usize,
    scale: f64,
    depth_min: Option<f32>,
    depth_max: Option<f32>,
    invalid_pixels: usize,
}

#[derive(Serialize)]
struct Sidecar<'a> {
    meaning: &'static str,
    unit: &'a str,
    color: &'static str,
    interrupted: bool,
    images: &'a [Entry],
}

/// Writes each image's two files at once; only the list is kept.
struct DepthSink {
    dir: PathBuf,
    unit: String,
    entries: Vec<Entry>,
    written: Vec<PathBuf>,
}

impl DepthSink {
    fn new(dir: &Path, options: &SinkOptions) -> Self {
        Self { dir: dir.to_owned(), unit: options.unit.clone(), entries: Vec::new(), written: Vec::new() }
    }
}

impl Sink for DepthSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        let valid = |d: &&f32| d.is_finite() && **d > 0.0;
        let min = frame.depth.iter().filter(valid).copied().reduce(f32::min);
        let max = frame.depth.iter().filter(valid).copied().reduce(f32::max);
        let scale = max.map_or(1.0, scale_for);
        let values: Vec<u16> = frame.depth.iter().map(|&d| quantise(d, scale)).collect();
        let file = format!("depth/{:06}.png", frame.index);
        let color_file = format!("depth_color/{:06}.png", frame.index);
        let size = (frame.width, frame.height);
        let mut png = encode(&self.dir.join(&file), bytemuck::cast_slice(&values), size, ExtendedColorType::L16)?;
        insert_text(&mut png, "omnix:depth_scale", &scale.to_string());
        self.written.push(atomic::write_file(self.dir.join(&file), &png)?);
        let colours = colour::colour_depth(frame.depth);
        let png = encode(&self.dir.join(&color_file), &colours, size, ExtendedColorType::Rgb8)?;
        self.written.push(atomic::write_file(self.dir.join(&color_file), &png)?);
        let invalid_pixels = values.iter().filter(|&&v| v == 0).count();
        let index = frame.index;
        self.entries.push(Entry { file, color_file, index, scale, depth_min: min, depth_max: max, invalid_pixels });
        Ok(())
    }

    fn finish(mut self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        if self.entries.is_empty() {
            return Ok(Vec::new());
        }
        let sidecar = Sidecar {
            meaning: "16-bit value * scale = depth along the camera's z axis; 0 = no depth",
            unit: &self.unit,
            color: "Spectral over inverse depth, 2nd to 98th percentile of each image: near red, far violet, no depth black",
            interrupted: summary.interrupted,
            images: &self.entries,
        };
        let path = self.dir.join("depth/depth.json");
        let json = serde_json::to_vec_pretty(&sidecar).map_err(|e| IoError::write(&path, e.into()))?;
        self.written.push(atomic::write_file(path, &json)?);
        Ok(self.written)
    }
}

/// The smallest power of two with which `max` fits 16 bits: exact in any number format, and mostly the same for neighbours. In f64,
/// whose shortest decimals are all of its digits: those of an f32 are rounded, and not by every library alike.
fn scale_for(max: f32) -> f64 {
    let exponent = (f64::from(max) / 65535.0).log2().ceil().clamp(-126.0, 127.0);
    let scale = exponent.exp2();
    // The logarithm may be off by its last bit just below a power of two.
    if f64::from(max) > 65535.0 * scale { 2.0 * scale } else { scale }
}

/// 0 for no depth; every real depth is at least 1.
fn quantise(depth: f32, scale: f64) -> u16 {
    if !(depth.is_finite() && depth > 0.0) {
        return 0;
    }
    (f64::from(depth) / scale).round().clamp(1.0, 65535.0) as u16
}

/// A whole PNG file in memory; `bytes` in the machine's byte order.
pub(super) fn encode(
    path: &Path,
    bytes: &[u8],
    (w, h): (u32, u32),
    colour: ExtendedColorType,
) -> Result<Vec<u8>, IoError> {
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(bytes, w, h, colour)
        .map_err(|e| IoError::write(path, std::io::Error::other(e)))?;
    Ok(png)
}

/// Puts a `tEXt` chunk (PNG, section 11.3.3.2) behind the header, where every reader accepts it.
fn insert_text(png: &mut Vec<u8>, keyword: &str, text: &str) {
    const AFTER_HEADER: usize = 8 + 25;
    let mut body = b"tEXt".to_vec();
    body.extend_from_slice(keyword.as_bytes());
    body.push(0);
    body.extend_from_slice(text.as_bytes());
    let mut chunk = (body.len() as u32 - 4).to_be_bytes().to_vec();
    chunk.extend_from_slice(&body);
    chunk.extend_from_slice(&crc32(&body).to_be_bytes());
    png.splice(AFTER_HEADER..AFTER_HEADER, chunk);
}

/// CRC-32 of PNG (annex D), bit by bit: a few dozen bytes per file.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc_of_the_check_string() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn scale_fits_and_is_a_power_of_two() {
        for max in [1e-30f32, 0.3, 1.0, 65535.0, 65536.0, 1e9, 0.999_99 * 65535.0 / 4.0, f32::MAX] {
            let scale = scale_for(max);
            assert!(f64::from(max) <= 65535.0 * scale, "{max} {scale}");
            assert!(f64::from(max) > 65535.0 * scale / 2.0 - 1e-6, "{max} {scale} wastes a bit");
            assert_eq!(scale.to_bits() << 12, 0, "{scale} is no power of two");
            // As the PNG and the list beside it say it.
            for text in [scale.to_string(), serde_json::to_string(&scale).expect("a number")] {
                assert_eq!(text.parse(), Ok(scale), "{text}");
            }
        }
        assert_eq!((scale_for(65535.0), scale_for(10.0).to_string().as_str()), (1.0, "0.000244140625"));
        assert_eq!((quantise(0.0, 1.0), quantise(f32::NAN, 1.0), quantise(1e-9, 1.0)), (0, 0, 1));
    }
}
