//! The points of all images that are worth drawing, and where they are at a time.
//!
//! What may move comes first and is placed anew for every time; the rest stays. Between two times points go straight. Points without a
//! surface (`surface.rs`) and of low confidence are left out; if there are too many, every n-th of an image is kept, with larger discs.

use std::ops::Range;

use omnix_geometry::Camera;

use super::surface::radii;
use super::{ImagePoints, Source};
use crate::error::OmnixError;

/// Which points of an image are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageOptions {
    /// At most this number of points over all images together.
    pub points: usize,
    /// Points below this percentile of their image's confidence are left out, 0 to 100.
    pub conf_percentile: f32,
    /// Radii are multiplied by this.
    pub splat: f32,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self { points: 20_000_000, conf_percentile: 0.0, splat: 1.0 }
    }
}

/// Which images' points are in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// Those of all images, each where it is at the picture's time.
    All,
    /// Those of the image nearest in time alone.
    Nearest,
}

/// Points with how they look, image by image.
#[derive(Clone, Debug, Default)]
struct Part {
    positions: Vec<[f32; 3]>,
    sizes: Vec<f32>,
    colours: Vec<u32>,
    /// Which pixels they are.
    pixels: Vec<u32>,
    /// Where each image's points are in these lists.
    images: Vec<Range<usize>>,
}

impl Part {
    fn push(&mut self, position: [f32; 3], size: f32, colour: [u8; 3], pixel: usize) {
        let [r, g, b] = colour;
        self.positions.push(position);
        self.sizes.push(size);
        self.colours.push(u32::from_le_bytes([r, g, b, 0]));
        self.pixels.push(pixel as u32);
    }

    fn end_image(&mut self) {
        let start = self.images.last().map_or(0, |range| range.end);
        self.images.push(start..self.positions.len());
    }
}

/// Points of a scene, ready to be drawn.
#[derive(Debug)]
pub struct Stage {
    moving: Part,
    still: Part,
    cameras: Vec<Camera>,
    size: [usize; 2],
    distance: f32,
    /// Positions of what moves at the last two times asked for.
    known: Vec<(usize, Vec<[f32; 3]>)>,
}

impl Stage {
    /// Points that a stage of this source has at most.
    #[must_use]
    pub fn bound(source: &dyn Source, options: &StageOptions) -> usize {
        let [width, height] = source.size();
        width.saturating_mul(height).saturating_mul(source.cameras().len()).min(options.points)
    }

    /// Reads all images; `on_image` is called before each.
    ///
    /// # Errors
    /// Failures of the source, or of `on_image`.
    pub fn read(
        source: &dyn Source,
        options: &StageOptions,
        on_image: &mut dyn FnMut(usize) -> Result<(), OmnixError>,
    ) -> Result<Self, OmnixError> {
        let (cameras, size) = (source.cameras(), source.size());
        let all = size[0] * size[1] * cameras.len();
        let share = (options.points as f64 / all.max(1) as f64).min(1.0);
        let (mut moving, mut still) = (Part::default(), Part::default());
        let mut distances = Vec::new();
        for (index, camera) in cameras.iter().enumerate() {
            on_image(index)?;
            let image = source.image(index)?;
            let depth: Vec<f32> = image.positions.iter().map(|point| depth(camera, *point)).collect();
            let focal = camera.intrinsics[0][0].max(camera.intrinsics[1][1]);
            let radii = radii(&image.positions, &depth, size, focal);
            distances.extend(middle(depth.iter().copied().filter(|d| d.is_finite() && *d > 0.0)));
            let least = least_confidence(&image, options.conf_percentile);
            let first = index * size[0] * size[1];
            for (pixel, radius) in radii.iter().enumerate().filter(|(_, radius)| **radius > 0.0) {
                // Of equal steps through all pixels, those that come to a new whole number.
                let kept = |pixel: usize| (share * (first + pixel) as f64).floor();
                let confident = image.confidence.as_ref().is_none_or(|c| c[pixel] >= least);
                if confident && (share == 1.0 || kept(pixel + 1) > kept(pixel)) {
                    let part = if image.moving[pixel] { &mut moving } else { &mut still };
                    let size = radius * options.splat / share.sqrt() as f32;
                    part.push(image.positions[pixel], size, image.colours[pixel], pixel);
                }
            }
            moving.end_image();
            still.end_image();
        }
        let distance = middle(distances).unwrap_or(1.0);
        Ok(Self { moving, still, cameras, size, distance, known: Vec::new() })
    }

    /// Cameras of the images, in the order of times.
    #[must_use]
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Width and height of the images.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// How far what is seen lies from the cameras: the median over the images of their median depth.
    #[must_use]
    pub fn distance(&self) -> f32 {
        self.distance
    }

    /// Number of points that may move, and of all points.
    #[must_use]
    pub fn count(&self) -> [usize; 2] {
        [self.moving.sizes.len(), self.moving.sizes.len() + self.still.sizes.len()]
    }

    /// Most points of a picture.
    #[must_use]
    pub fn most_shown(&self, shown: Shown) -> usize {
        match shown {
            Shown::All => self.count()[1],
            Shown::Nearest => {
                let images = self.moving.images.iter().zip(&self.still.images);
                images.map(|(moving, still)| moving.len() + still.len()).max().unwrap_or(0)
            }
        }
    }

    /// Radii and colours of the points of all images, in the order of positions: what moves, then what does not.
    #[must_use]
    pub fn looks(&self) -> [(&[f32], &[u32]); 2] {
        [&self.moving, &self.still].map(|part| (part.sizes.as_slice(), part.colours.as_slice()))
    }

    /// Where the points that do not move are.
    #[must_use]
    pub fn still(&self) -> &[[f32; 3]] {
        &self.still.positions
    }

    /// Which of the points belong to an image: ranges of what moves and of what does not.
    #[must_use]
    pub fn of_image(&self, image: usize) -> [Range<usize>; 2] {
        [self.moving.images[image].clone(), self.still.images[image].clone()]
    }

    /// Where the points that may move are at a time, from 0 for the first image to the number of images less one.
    ///
    /// # Errors
    /// Failures of the source.
    pub fn moving_at(&mut self, source: &dyn Source, time: f64) -> Result<Vec<[f32; 3]>, OmnixError> {
        let last = self.cameras.len().saturating_sub(1);
        let time = time.clamp(0.0, last as f64);
        let (low, part) = (time.floor() as usize, time.fract() as f32);
        let from = self.at_image(source, low)?;
        if part == 0.0 {
            return Ok(from);
        }
        let to = self.at_image(source, low + 1)?;
        let between = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * part);
        Ok(from.iter().zip(&to).map(between).collect())
    }

    /// Where the points that may move are when an image is taken.
    fn at_image(&mut self, source: &dyn Source, time: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
        if let Some((_, positions)) = self.known.iter().find(|(known, _)| *known == time) {
            return Ok(positions.clone());
        }
        let mut positions = Vec::with_capacity(self.moving.positions.len());
        for (image, range) in self.moving.images.iter().enumerate() {
            let pixels = &self.moving.pixels[range.clone()];
            if !pixels.is_empty() {
                positions.extend(source.positions(image, pixels, time)?);
            }
        }
        if self.known.len() == 2 {
            self.known.remove(0);
        }
        self.known.push((time, positions.clone()));
        Ok(positions)
    }

    /// Image and pixel of about `count` of the points that may move, evenly chosen.
    pub(super) fn some_moving(&self, count: usize) -> Vec<(usize, Vec<u32>)> {
        let all = self.moving.pixels.len();
        let step = all.div_ceil(count.max(1)).max(1);
        let of_image = |(image, range): (usize, &Range<usize>)| {
            let pixels = range.clone().filter(|i| i % step == step / 2).map(|i| self.moving.pixels[i]);
            (image, pixels.collect())
        };
        self.moving.images.iter().enumerate().map(of_image).collect()
    }
}

fn depth(camera: &Camera, point: [f32; 3]) -> f32 {
    let row = camera.extrinsics[2];
    (0..3).map(|c| row[c] * point[c]).sum::<f32>() + row[3]
}

/// The lower median.
fn middle(values: impl IntoIterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.into_iter().collect();
    let at = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}

/// The confidence below which points are left out.
fn least_confidence(image: &ImagePoints, percentile: f32) -> f32 {
    let mut values: Vec<f32> = image.confidence.iter().flatten().copied().filter(|c| c.is_finite()).collect();
    if values.is_empty() || percentile <= 0.0 {
        return f32::NEG_INFINITY;
    }
    let at = (f64::from(percentile.min(100.0)) / 100.0 * (values.len() - 1) as f64) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use omnix_geometry::IDENTITY_POSE;

    use super::*;

    /// Two images of a wall two units away; in the left half of each, points go right by one unit a time.
    struct Wall;

    const SIZE: [usize; 2] = [8, 4];

    fn place(pixel: usize) -> [f32; 3] {
        [(pixel % 8) as f32 / 50.0, (pixel / 8) as f32 / 50.0, 2.0]
    }

    impl Source for Wall {
        fn size(&self) -> [usize; 2] {
            SIZE
        }

        fn cameras(&self) -> Vec<Camera> {
            let intrinsics = [[100.0, 0.0, 4.0], [0.0, 100.0, 2.0], [0.0, 0.0, 1.0]];
            vec![Camera { extrinsics: IDENTITY_POSE, intrinsics }; 2]
        }

        fn image(&self, _: usize) -> Result<ImagePoints, OmnixError> {
            Ok(ImagePoints {
                positions: (0..32).map(place).collect(),
                colours: (0..32).map(|pixel| [pixel as u8, 0, 7]).collect(),
                confidence: Some((0..32).map(|pixel| pixel as f32).collect()),
                moving: (0..32).map(|pixel| pixel % 8 < 4).collect(),
            })
        }

        fn positions(&self, image: usize, pixels: &[u32], time: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
            let step = time as f32 - image as f32;
            Ok(pixels.iter().map(|pixel| place(*pixel as usize)).map(|[x, y, z]| [x + step, y, z]).collect())
        }
    }

    fn read(options: &StageOptions) -> Stage {
        Stage::read(&Wall, options, &mut |_| Ok(())).unwrap()
    }

    #[test]
    fn what_moves_is_placed_between_times() {
        let mut stage = read(&StageOptions::default());
        assert_eq!((stage.count(), stage.distance()), ([32, 64], 2.0));
        assert_eq!((stage.most_shown(Shown::All), stage.most_shown(Shown::Nearest)), (64, 32));
        let at = stage.moving_at(&Wall, 0.25).unwrap();
        // The first image's points are on their way, the second's come from where they were.
        assert_eq!((at[0][0], at[16][0]), (0.25, -0.75));
        assert_eq!(stage.moving_at(&Wall, 7.0).unwrap()[16], place(0));
        assert_eq!(stage.still()[0], place(4));
        assert_eq!(stage.looks()[1].1[0], 4 + (7 << 16));
        assert_eq!(stage.of_image(1), [16..32, 16..32]);
    }

    #[test]
    fn fewer_points_have_larger_discs() {
        let (all, some) = (read(&StageOptions::default()), read(&StageOptions { points: 16, ..Default::default() }));
        assert_eq!(some.count()[1], 16);
        assert!((some.looks()[1].0[0] / all.looks()[1].0[0] - 2.0).abs() < 1e-5);
        assert_eq!(Stage::bound(&Wall, &StageOptions { points: 16, ..Default::default() }), 16);
        let sure = read(&StageOptions { conf_percentile: 50.0, ..Default::default() });
        assert_eq!(sure.count()[1], 2 * 17);
    }
}
