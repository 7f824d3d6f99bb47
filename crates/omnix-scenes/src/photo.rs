//! Photographs as textures: a pyramid of halved pictures, read between pixels and between levels, mirrored at the edges.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::error::ScenesError;

/// Longest side of a texture; larger pictures are made smaller.
const LONGEST: u32 = 512;
/// Most pictures of a folder: they stay in memory, up to 4 MiB each.
const MOST_PICTURES: usize = 150;
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
        let size = image::image_dimensions(path).map_err(|error| failed(error.to_string()))?;
        if u64::from(size.0) * u64::from(size.1) > MOST_PIXELS || size.0 == 0 || size.1 == 0 {
            return Err(failed(format!("it has {} x {} pixels", size.0, size.1)));
        }
        let picture = image::open(path).map_err(|error| failed(error.to_string()))?;
        let picture = if size.0.max(size.1) > LONGEST { picture.thumbnail(LONGEST, LONGEST) } else { picture };
        let picture = picture.to_rgb8();
        let linear = |v: u8| crate::lens::linear(f32::from(v) / 255.0);
        let pixels = picture.pixels().map(|p| Vec3::new(linear(p[0]), linear(p[1]), linear(p[2]))).collect();
        let first = Level { width: picture.width() as usize, height: picture.height() as usize, pixels };
        let mut levels = vec![first];
        while levels.last().is_some_and(|level| level.width.max(level.height) > 1) {
            levels.extend(levels.last().map(Level::half));
        }
        Ok(Self { levels })
    }

    pub(crate) fn mean(&self) -> Vec3 {
        self.levels.last().map_or(Vec3::splat(0.5), |level| level.pixels[0])
    }

    /// The colour at a place; the picture is one unit wide.
    pub(crate) fn colour(&self, q: Vec2, blur: f32) -> Vec3 {
        let fine = (blur * self.levels[0].width as f32).max(1.0).log2();
        let last = self.levels.len() - 1;
        let level = (fine as usize).min(last);
        let next = (level + 1).min(last);
        self.levels[level].at(q).lerp(self.levels[next].at(q), fine.fract())
    }
}

/// The pictures in a folder and the folders below it, in the order of their paths: at most 150, evenly chosen. Files of other kinds
/// are left out.
///
/// # Errors
/// A folder that cannot be read or holds no picture, and a picture that cannot be used.
pub fn read_photos(folder: &Path) -> Result<Vec<Arc<Photo>>, ScenesError> {
    let mut paths: Vec<PathBuf> = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let failed = |source| ScenesError::Read { path: folder.clone(), source };
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            // Links are not followed: they may lead in a circle.
            let kind = entry.file_type().map_err(failed)?;
            let path = entry.path();
            let ending = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_ascii_lowercase();
            if kind.is_dir() {
                folders.push(path);
            } else if ["jpg", "jpeg", "png", "webp", "bmp"].contains(&ending.as_str()) {
                paths.push(path);
            }
        }
    }
    if paths.is_empty() {
        let reason = "it holds no JPEG, PNG, WebP or BMP".to_owned();
        return Err(ScenesError::Texture { reason, path: folder.to_owned() });
    }
    paths.sort();
    let count = paths.len().min(MOST_PICTURES);
    let chosen: Vec<&PathBuf> = (0..count).map(|k| &paths[k * paths.len() / count]).collect();
    chosen.into_par_iter().map(|path| Photo::read(path).map(Arc::new)).collect()
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

    fn at(&self, q: Vec2) -> Vec3 {
        let mirrored = |v: f32| 1.0 - (v.rem_euclid(2.0) - 1.0).abs();
        let aspect = self.width as f32 / self.height as f32;
        let x = (mirrored(q.x) * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = (mirrored(-q.y * aspect) * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
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

    #[test]
    fn pictures_are_read_and_what_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let empty = read_photos(folder.path()).unwrap_err().to_string();
        assert!(empty.contains("no JPEG"), "{empty}");
        let below = folder.path().join("below");
        std::fs::create_dir(&below).unwrap();
        let halves = image::RgbImage::from_fn(64, 48, |x, _| image::Rgb([if x < 32 { 255 } else { 0 }, 0, 0]));
        halves.save(below.join("halves.png")).unwrap();
        std::fs::write(folder.path().join("notes.txt"), "no picture").unwrap();
        let photos = read_photos(folder.path()).unwrap();
        assert_eq!(photos.len(), 1);
        let at = |x: f32, blur: f32| photos[0].colour(Vec2::new(x, -0.3), blur).x;
        assert!(at(0.25, 0.001) > 0.99 && at(0.75, 0.001) < 0.01 && (at(0.5, 2.0) - 0.5).abs() < 0.01);
        // Mirrored beyond its edges.
        assert_eq!(at(-0.25, 0.001), at(0.25, 0.001));
        std::fs::write(folder.path().join("broken.jpg"), "no picture").unwrap();
        assert!(read_photos(folder.path()).unwrap_err().to_string().contains("broken.jpg"));
    }
}
