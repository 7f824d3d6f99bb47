//! Pictures as textures: a pyramid of halved ones, read between pixels and between levels.

use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

use glam::{Vec2, Vec3};
use image::{DynamicImage, ImageDecoder as _, ImageReader, Limits};

use crate::error::ScenesError;

/// Longest side of a texture; larger pictures are made smaller.
const LONGEST: u32 = 512;
/// Most pixels of a picture that is read.
const MOST_PIXELS: u64 = 100_000_000;

/// A picture at all sizes, linear RGB.
#[derive(Debug)]
pub struct Photo {
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
}

impl Photo {
    /// Reads a PNG, JPEG, WebP or BMP file.
    ///
    /// # Errors
    /// A file that is no such picture, or one of more than 100 million pixels.
    pub fn read(path: &Path) -> Result<Self, ScenesError> {
        let failed = |reason: String| ScenesError::Texture { reason, path: path.to_owned() };
        let reader = ImageReader::open(path).map_err(|error| failed(error.to_string()))?;
        Self::decode(reader, LONGEST).map(|(photo, _)| photo).map_err(failed)
    }

    /// A picture in memory as a texture of at most `longest` pixels a side, and the part of its pixels that are transparent.
    pub(crate) fn of_bytes(bytes: &[u8], longest: u32) -> Result<(Self, f64), String> {
        Self::decode(ImageReader::new(Cursor::new(bytes)), longest)
    }

    fn decode<R: BufRead + Seek>(reader: ImageReader<R>, longest: u32) -> Result<(Self, f64), String> {
        let told = |error: image::ImageError| error.to_string();
        let guessed = reader.with_guessed_format().map_err(|error| error.to_string())?;
        let mut decoder = guessed.into_decoder().map_err(told)?;
        let size = decoder.dimensions();
        if u64::from(size.0) * u64::from(size.1) > MOST_PIXELS || size.0 == 0 || size.1 == 0 {
            return Err(format!("it has {} x {} pixels", size.0, size.1));
        }
        // What decoding takes beside the picture itself is bounded too.
        decoder.set_limits(Limits::default()).map_err(told)?;
        let picture = DynamicImage::from_decoder(decoder).map_err(told)?;
        let picture = if size.0.max(size.1) > longest { picture.thumbnail(longest, longest) } else { picture };
        let clear = if picture.color().has_alpha() {
            let picture = picture.to_rgba8();
            let count = picture.pixels().filter(|pixel| pixel[3] < 128).count();
            count as f64 / f64::from(picture.width() * picture.height())
        } else {
            0.0
        };
        let picture = picture.to_rgb8();
        let linear = |v: u8| crate::lens::linear(f32::from(v) / 255.0);
        let pixels = picture.pixels().map(|p| Vec3::new(linear(p[0]), linear(p[1]), linear(p[2]))).collect();
        let first = Level { width: picture.width() as usize, height: picture.height() as usize, pixels };
        let mut levels = vec![first];
        while levels.last().is_some_and(|level| level.width.max(level.height) > 1) {
            levels.extend(levels.last().map(Level::half));
        }
        Ok((Self { levels }, clear))
    }

    pub(crate) fn mean(&self) -> Vec3 {
        self.levels.last().map_or(Vec3::splat(0.5), |level| level.pixels[0])
    }

    /// The colour at a place; the picture is one unit wide, and mirrored beyond its edges.
    pub(crate) fn colour(&self, q: Vec2, blur: f32) -> Vec3 {
        let mirrored = |v: f32| 1.0 - (v.rem_euclid(2.0) - 1.0).abs();
        let first = &self.levels[0];
        let aspect = first.width as f32 / first.height as f32;
        self.blurred(Vec2::new(mirrored(q.x), mirrored(-q.y * aspect)), blur)
    }

    /// The colour at texture coordinates: the picture is one unit wide and high, begins at its lower left corner, and is repeated
    /// beyond its edges.
    pub(crate) fn wrapped(&self, q: Vec2, blur: f32) -> Vec3 {
        self.blurred(Vec2::new(q.x - q.x.floor(), 1.0 - (q.y - q.y.floor())), blur)
    }

    /// The mean about a place in [0, 1] from the upper left corner, over a part of the picture's width.
    fn blurred(&self, place: Vec2, blur: f32) -> Vec3 {
        let fine = (blur * self.levels[0].width as f32).max(1.0).log2();
        let last = self.levels.len() - 1;
        let level = (fine as usize).min(last);
        let next = (level + 1).min(last);
        self.levels[level].at(place).lerp(self.levels[next].at(place), fine.fract())
    }
}

impl Level {
    /// Each pixel the mean of up to four.
    fn half(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let pixel = |x: usize, y: usize| {
            let xs = [2 * x, (2 * x + 1).min(self.width - 1)];
            let ys = [2 * y, (2 * y + 1).min(self.height - 1)];
            let sum: Vec3 = ys.iter().flat_map(|y| xs.map(|x| self.pixels[y * self.width + x])).sum();
            sum * 0.25
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Self { width, height, pixels }
    }

    fn at(&self, place: Vec2) -> Vec3 {
        let x = (place.x * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = (place.y * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        let (left, top) = (x as usize, y as usize);
        let pixel = |dx: usize, dy: usize| {
            self.pixels[(top + dy).min(self.height - 1) * self.width + (left + dx).min(self.width - 1)]
        };
        let above = pixel(0, 0).lerp(pixel(1, 0), x.fract());
        let below = pixel(0, 1).lerp(pixel(1, 1), x.fract());
        above.lerp(below, y.fract())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(picture: &DynamicImage) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn pictures_are_mirrored_as_photographs_and_repeated_as_textures() {
        let halves = image::RgbImage::from_fn(64, 48, |x, _| image::Rgb([if x < 32 { 255 } else { 0 }, 0, 0]));
        let (photo, clear) = Photo::of_bytes(&png(&halves.into()), 512).unwrap();
        assert_eq!(clear, 0.0);
        let at = |x: f32, blur: f32| photo.colour(Vec2::new(x, -0.3), blur).x;
        assert!(at(0.25, 0.001) > 0.99 && at(0.75, 0.001) < 0.01 && (at(0.5, 2.0) - 0.5).abs() < 0.01);
        assert_eq!(at(-0.25, 0.001), at(0.25, 0.001));
        let at = |x: f32| photo.wrapped(Vec2::new(x, 0.3), 0.001).x;
        assert!(at(0.25) > 0.99 && at(-0.75) > 0.99 && at(-0.25) < 0.01 && at(7.75) < 0.01);
    }

    #[test]
    fn the_first_row_is_at_the_top_and_holes_are_counted() {
        let quarter = image::RgbaImage::from_fn(8, 8, |x, y| {
            image::Rgba([if y < 4 { 255 } else { 0 }, 0, 0, if x < 4 && y < 4 { 0 } else { 255 }])
        });
        let (photo, clear) = Photo::of_bytes(&png(&quarter.into()), 512).unwrap();
        assert_eq!(clear, 0.25);
        let at = |y: f32| photo.wrapped(Vec2::new(0.5, y), 0.001).x;
        assert!(at(0.75) > 0.99 && at(0.25) < 0.01);
        assert!(Photo::of_bytes(b"no picture", 512).is_err());
    }
}
