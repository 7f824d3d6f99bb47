//! A contact sheet: what a sample holds, for eyes. A row per kind (pictures, depth, what moves, paths), a column per image.
//!
//! Depth is coloured by its inverse between the 2nd and 98th percentile of all images, near is red, far is violet, unknown is black. What
//! moves is red over the grey picture, unknown is blue. Paths are lines through the places of a point at all times, a dot at the image's own.

use glam::DVec3;
use omnix_io::Picture;
use omnix_io::output::spectral;

use crate::rigid::Pinhole;
use crate::{Flag, Motion, Sample};

/// Width of a tile in pixels, at most, and number of columns, at most.
const TILE: usize = 240;
const COLUMNS: usize = 8;
/// Paths per image.
const PATHS: usize = 120;
const GAP: usize = 4;
/// Scenes of an overview, at most, and side by side.
const SCENES: usize = 24;
const ACROSS: usize = 4;

/// Draws the sheet of a sample.
#[must_use]
pub fn sheet(sample: &Sample) -> Picture {
    let count = sample.count();
    let shown: Vec<usize> = (0..count.min(COLUMNS)).map(|k| k * count / count.min(COLUMNS)).collect();
    let tiles = Tiles::of(sample);
    let (wide, high) = (tiles.wide, tiles.high);
    let mut rows: Vec<Vec<Vec<[u8; 3]>>> = vec![shown.iter().map(|image| tiles.picture(*image)).collect()];
    if sample.parts().depth.is_some() {
        let range = inverse_range(sample);
        rows.push(shown.iter().map(|image| tiles.depth(*image, range)).collect());
    }
    if sample.parts().moving.is_some() {
        rows.push(shown.iter().map(|image| tiles.moving(*image)).collect());
    }
    if *sample.motion() != Motion::Unknown {
        rows.push(shown.iter().map(|image| tiles.paths(*image)).collect());
    }
    grid(&rows, [wide, high])
}

/// Rows of tiles of one size, the first row the longest.
fn grid(rows: &[Vec<Vec<[u8; 3]>>], [wide, high]: [usize; 2]) -> Picture {
    let across = rows.first().map_or(0, Vec::len) * (wide + GAP) + GAP;
    let down = rows.len() * (high + GAP) + GAP;
    let mut data = vec![24u8; across * down * 3];
    for (r, row) in rows.iter().enumerate() {
        for (c, tile) in row.iter().enumerate() {
            for (y, line) in tile.chunks_exact(wide).enumerate() {
                let at = ((GAP + r * (high + GAP) + y) * across + GAP + c * (wide + GAP)) * 3;
                data[at..at + wide * 3].copy_from_slice(line.as_flattened());
            }
        }
    }
    Picture::new(across as u32, down as u32, data)
}

/// Many scenes in one picture: of each an image, and its depth below it.
#[derive(Debug, Clone, Default)]
pub struct Overview {
    size: [usize; 2],
    /// Picture and depth.
    scenes: Vec<[Vec<[u8; 3]>; 2]>,
}

impl Overview {
    /// Adds the middle image of a sample. A sample without depth, one whose tile has another size than the first one's, and what is more
    /// than 24 scenes are left out.
    pub fn add(&mut self, sample: &Sample) {
        let tiles = Tiles::of(sample);
        if self.scenes.is_empty() {
            self.size = [tiles.wide, tiles.high];
        }
        let fits = self.size == [tiles.wide, tiles.high] && sample.parts().depth.is_some();
        if fits && self.scenes.len() < SCENES {
            let image = sample.count() / 2;
            self.scenes.push([tiles.picture(image), tiles.depth(image, inverse_range(sample))]);
        }
    }

    /// The picture; none without a scene.
    #[must_use]
    pub fn picture(&self) -> Option<Picture> {
        let kind = |scenes: &[[Vec<[u8; 3]>; 2]], k: usize| scenes.iter().map(|tiles| tiles[k].clone()).collect();
        let rows: Vec<_> = self.scenes.chunks(ACROSS).flat_map(|scenes| [kind(scenes, 0), kind(scenes, 1)]).collect();
        (!rows.is_empty()).then(|| grid(&rows, self.size))
    }
}

/// The 2nd and 98th percentile of inverse depth.
fn inverse_range(sample: &Sample) -> [f32; 2] {
    let depth = sample.parts().depth.as_deref().unwrap_or_default();
    let step = (depth.len() / 100_000).max(1);
    let mut values: Vec<f32> = depth.iter().step_by(step).filter(|z| z.is_finite()).map(|z| 1.0 / z).collect();
    values.sort_unstable_by(f32::total_cmp);
    let rank =
        |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    [rank(0.02), rank(0.98)]
}

struct Tiles<'a> {
    sample: &'a Sample,
    every: usize,
    wide: usize,
    high: usize,
}

impl<'a> Tiles<'a> {
    fn of(sample: &'a Sample) -> Self {
        let [width, height] = sample.size().map(|side| side as usize);
        // Whole pixels are left out, none are made.
        let every = width.div_ceil(TILE).max(1);
        Self { sample, every, wide: width.div_ceil(every), high: height.div_ceil(every) }
    }

    /// The pixels of a tile, of each the pixel of the image.
    fn pixels(&self) -> impl Iterator<Item = usize> {
        let width = self.sample.size()[0] as usize;
        (0..self.high).flat_map(move |y| (0..self.wide).map(move |x| y * self.every * width + x * self.every))
    }

    fn colour(&self, image: usize, pixel: usize) -> [u8; 3] {
        let bytes = &self.sample.image(image)[pixel * 3..pixel * 3 + 3];
        [bytes[0], bytes[1], bytes[2]]
    }

    fn grey(&self, image: usize, pixel: usize) -> u8 {
        let sum: u32 = self.colour(image, pixel).iter().map(|v| u32::from(*v)).sum();
        (sum / 5) as u8
    }

    fn picture(&self, image: usize) -> Vec<[u8; 3]> {
        self.pixels().map(|pixel| self.colour(image, pixel)).collect()
    }

    fn depth(&self, image: usize, [low, high]: [f32; 2]) -> Vec<[u8; 3]> {
        let depth = self.sample.depth(image).unwrap_or_default();
        let range = if high > low { high - low } else { f32::INFINITY };
        let shade =
            |z: f32| if z.is_nan() { [0; 3] } else { spectral(1.0 - ((1.0 / z - low) / range).clamp(0.0, 1.0)) };
        self.pixels().map(|pixel| shade(depth[pixel])).collect()
    }

    fn moving(&self, image: usize) -> Vec<[u8; 3]> {
        let moving = self.sample.moving(image).unwrap_or_default();
        let shade = |pixel: usize| {
            let grey = self.grey(image, pixel);
            match moving[pixel] {
                Flag::No => [grey; 3],
                Flag::Yes => [grey / 2 + 128, grey / 3, grey / 3],
                Flag::Unknown => [grey / 3, grey / 3, grey / 2 + 96],
            }
        };
        self.pixels().map(shade).collect()
    }

    fn paths(&self, image: usize) -> Vec<[u8; 3]> {
        let mut tile: Vec<[u8; 3]> = self.pixels().map(|pixel| [self.grey(image, pixel); 3]).collect();
        let camera = Pinhole::new(&self.sample.cameras()[image]);
        let every = self.every as f64;
        let place = |p: [f32; 3]| {
            let seen = camera.w2c.apply(DVec3::from(p.map(f64::from)));
            let [u, v] = camera.project(seen);
            (seen.z > 0.0 && u.is_finite() && v.is_finite()).then_some([u / every, v / every])
        };
        for (k, path) in chosen(self.sample, image).into_iter().enumerate() {
            let colour = spectral((k as f32 * 0.618_034).fract());
            let places: Vec<_> = path.into_iter().map(place).collect();
            for pair in places.windows(2) {
                if let [Some(from), Some(to)] = pair {
                    self.line(&mut tile, *from, *to, colour);
                }
            }
            if let Some(own) = places[image] {
                self.line(&mut tile, [own[0] - 1.0, own[1]], [own[0] + 1.0, own[1]], [255; 3]);
            }
        }
        tile
    }

    fn line(&self, tile: &mut [[u8; 3]], from: [f64; 2], to: [f64; 2], colour: [u8; 3]) {
        let longest = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
        // Longer lines lie outside for the most part, and would take long.
        let steps = longest.ceil().clamp(1.0, 4096.0);
        for k in 0..=steps as usize {
            let part = k as f64 / steps;
            let [x, y] = [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part);
            if x >= 0.0 && y >= 0.0 && x < self.wide as f64 && y < self.high as f64 {
                tile[y as usize * self.wide + x as usize] = colour;
            }
        }
    }
}

/// Paths to draw in an image: those that move come first.
fn chosen(sample: &Sample, image: usize) -> Vec<Vec<[f32; 3]>> {
    let count = sample.count();
    let spread = |mut all: Vec<usize>| {
        let step = all.len().div_ceil(PATHS).max(1);
        all = all.into_iter().step_by(step).collect();
        all
    };
    match sample.motion() {
        Motion::Unknown => Vec::new(),
        Motion::Dense(_) => {
            let moves = |pixel: usize| sample.moving(image).is_none_or(|moving| moving[pixel] == Flag::Yes);
            let known = |pixel: usize| sample.positions(image, image).is_some_and(|own| own[pixel][0].is_finite());
            let moving: Vec<usize> = (0..sample.pixels()).filter(|p| moves(*p) && known(*p)).collect();
            let at = |pixel: usize, time: usize| sample.positions(image, time).map_or([f32::NAN; 3], |map| map[pixel]);
            spread(moving).into_iter().map(|pixel| (0..count).map(|time| at(pixel, time)).collect()).collect()
        }
        Motion::Tracks(tracks) => {
            let seen = |track: usize| tracks.visible[image * tracks.count + track] == Flag::Yes;
            let visible: Vec<usize> = (0..tracks.count).filter(|track| seen(*track)).collect();
            let path = |track: usize| (0..count).map(|time| tracks.positions[time * tracks.count + track]).collect();
            spread(visible).into_iter().map(path).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    fn tile(picture: &Picture, column: usize, row: usize, [wide, high]: [usize; 2]) -> Vec<[u8; 3]> {
        let at = |x: usize, y: usize| {
            ((GAP + row * (high + GAP) + y) * picture.width as usize + GAP + column * (wide + GAP) + x) * 3
        };
        let pixel = |at: usize| [picture.data[at], picture.data[at + 1], picture.data[at + 2]];
        (0..high).flat_map(|y| (0..wide).map(move |x| (x, y))).map(|(x, y)| pixel(at(x, y))).collect()
    }

    #[test]
    fn a_row_per_kind_and_a_column_per_image() {
        let sample = made::video([56, 28], 3);
        let picture = sheet(&sample);
        assert_eq!([picture.width, picture.height], [3 * 60 + 4, 4 * 32 + 4]);
        assert_eq!(tile(&picture, 1, 0, [56, 28]).as_flattened(), sample.image(1));
        let red = tile(&picture, 2, 2, [56, 28]).iter().filter(|p| p[0] > p[1]).count();
        let moving = sample.moving(2).unwrap().iter().filter(|flag| **flag == Flag::Yes).count();
        assert_eq!(red, moving);
        // Paths are coloured over grey.
        assert!(tile(&picture, 0, 3, [56, 28]).iter().any(|p| p[0] != p[1]));
        // Near is red: the plate is nearer than the wall.
        let depth = tile(&picture, 0, 1, [56, 28]);
        let nearest = (0..56 * 28).min_by(|a, b| sample.depth(0).unwrap()[*a].total_cmp(&sample.depth(0).unwrap()[*b]));
        assert!(depth[nearest.unwrap()][0] > depth[nearest.unwrap()][2]);
    }

    #[test]
    fn an_overview_has_a_picture_over_its_depth() {
        let mut overview = Overview::default();
        assert!(overview.picture().is_none());
        let sample = made::video([56, 28], 3);
        for _ in 0..5 {
            overview.add(&sample);
        }
        // Another size, and no depth.
        overview.add(&made::video([28, 28], 3));
        let mut parts = sample.clone().into_parts();
        parts.depth = None;
        overview.add(&Sample::new(parts).unwrap());
        let picture = overview.picture().unwrap();
        assert_eq!([picture.width, picture.height], [4 * 60 + 4, 4 * 32 + 4]);
        assert_eq!(tile(&picture, 0, 2, [56, 28]).as_flattened(), sample.image(1));
        assert_eq!(tile(&picture, 3, 1, [56, 28]), tile(&sheet(&sample), 1, 1, [56, 28]));
        assert!(tile(&picture, 1, 2, [56, 28]).iter().all(|pixel| *pixel == [24; 3]), "nothing");
        (0..40).for_each(|_| overview.add(&sample));
        assert_eq!(overview.picture().unwrap().height, 12 * 32 + 4);
    }

    #[test]
    fn odd_samples_are_drawn() {
        let mut parts = made::video([3, 2], 1).into_parts();
        parts.depth.as_mut().unwrap().fill(f32::NAN);
        parts.moving = None;
        let mut only = parts.clone();
        only.depth = None;
        only.motion = Motion::Unknown;
        for parts in [parts, only] {
            assert_eq!(sheet(&Sample::new(parts).unwrap()).width, 3 + 8);
        }
        // Larger than a tile.
        let large = made::sample([500, 100], &[(made::time(0, 0), made::path([500, 100], 0, 0))]);
        assert_eq!(sheet(&large).width, 167 + 8);
    }
}
