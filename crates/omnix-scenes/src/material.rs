//! What a surface looks like: a pattern over texture positions, and how it reflects.
//!
//! Colours are linear RGB reflectances. A pattern is a pure function of the texture position (metres on the undeformed object), the
//! dominant axis of its normal and the pixel's footprint there; details finer than the footprint go over into their mean, so a
//! picture needs no oversampling inside a surface. f32 throughout.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::noise::{cell, fractal, noise};
use crate::photo::Photo;

/// The arrangement of a surface's colours.
#[derive(Debug, Clone)]
pub(crate) enum Pattern {
    /// The first colour.
    Plain,
    /// Fractal noise between the first two colours.
    Clouds,
    /// Small grains of the second colour.
    Grains,
    /// Squares.
    Checks,
    /// Stripes along the second coordinate: width of the second colour in parts of the period.
    Stripes(f32),
    /// Bricks or tiles: length over height, joint in parts of the height, shift of every other row in parts of the length.
    Bricks { aspect: f32, joint: f32, shift: f32 },
    /// Boards along one axis, each with its own shade and grain.
    Planks { aspect: f32 },
    /// Grain of solid wood along x.
    Wood,
    /// Veins.
    Marble,
    /// Round spots.
    Dots(f32),
    /// Woven threads.
    Weave,
    /// Cells of random colours, as in stone or gravel.
    Cells,
    /// Lines of text-like marks on paper.
    Text,
    /// Spines of books along x, in random colours.
    Spines,
    /// A picture of random rectangles, discs and gradients; one unit of scale is its size.
    Poster,
    /// A photograph; one unit of scale is its width.
    Photo(Arc<Photo>),
    /// The texture of an imported model, times the first colour: the texture position is its coordinates times the scale.
    Wrapped(Arc<Photo>),
}

/// A surface's look.
#[derive(Debug, Clone)]
pub(crate) struct Material {
    pub(crate) pattern: Pattern,
    pub(crate) colours: [Vec3; 3],
    /// Metres to a unit of the pattern.
    pub(crate) scale: f32,
    pub(crate) offset: Vec3,
    pub(crate) seed: u32,
    /// Strength of slow changes of brightness, as from dirt and wear.
    pub(crate) stain: f32,
    /// Reflectance of the highlight at normal incidence.
    pub(crate) gloss: f32,
    /// Width of the highlight: 0 a mirror, 1 none.
    pub(crate) rough: f32,
    /// Its own light, in multiples of the pattern's colour.
    pub(crate) glow: f32,
    /// Slope of small bumps.
    pub(crate) bump: f32,
}

impl Material {
    pub(crate) fn plain(colour: Vec3) -> Self {
        Self {
            pattern: Pattern::Plain,
            colours: [colour; 3],
            scale: 1.0,
            offset: Vec3::ZERO,
            seed: 0,
            stain: 0.0,
            gloss: 0.04,
            rough: 0.6,
            glow: 0.0,
            bump: 0.0,
        }
    }

    /// The colour at a texture position with a normal there; `footprint` is a pixel's width in metres.
    pub(crate) fn colour(&self, rest: Vec3, normal: Vec3, footprint: f32) -> Vec3 {
        let p = (rest + self.offset) / self.scale;
        let blur = (footprint / self.scale).max(1e-4);
        let colour = self.patterned(p, flat(p, normal), blur);
        if self.stain == 0.0 {
            return colour;
        }
        let slow = fractal((rest + self.offset) * 1.7, 3, footprint * 1.7, self.seed ^ 0x51a1);
        colour * (1.0 + self.stain * 2.0 * (slow - 0.5))
    }

    /// A colour for light that comes from this surface by way of another one.
    pub(crate) fn mean(&self) -> Vec3 {
        match &self.pattern {
            Pattern::Plain => self.colours[0],
            Pattern::Photo(photo) => photo.mean(),
            Pattern::Wrapped(photo) => photo.mean() * self.colours[0],
            _ => (self.colours[0] * 2.0 + self.colours[1]) / 3.0,
        }
    }

    /// A slope of the bumps at a texture position, to be added to the normal.
    pub(crate) fn slope(&self, rest: Vec3, footprint: f32) -> Vec3 {
        if self.bump == 0.0 {
            return Vec3::ZERO;
        }
        let p = (rest + self.offset) * (6.0 / self.scale);
        let fade = (1.5 - footprint * 6.0 / self.scale).clamp(0.0, 1.0);
        if fade == 0.0 {
            return Vec3::ZERO;
        }
        let along = |shift: Vec3, k: u32| noise(p + shift, self.seed.wrapping_add(k)) - 0.5;
        Vec3::new(along(Vec3::ZERO, 1), along(Vec3::splat(0.4), 2), along(Vec3::splat(0.7), 3)) * self.bump * fade
    }

    fn patterned(&self, p: Vec3, q: Vec2, blur: f32) -> Vec3 {
        let [a, b, c] = self.colours;
        let seed = self.seed;
        match &self.pattern {
            Pattern::Plain => a,
            Pattern::Clouds => a.lerp(b, contrast(fractal(p, 5, blur, seed), 1.6)),
            Pattern::Grains => {
                let fine = contrast(fractal(p * 3.0, 3, blur * 3.0, seed), 2.5);
                let broad = contrast(fractal(p * 0.12, 4, blur * 0.12, seed ^ 3), 1.8);
                let patch = contrast(fractal(p * 0.017, 3, blur * 0.017, seed ^ 4), 3.0);
                a.lerp(b, fine * 0.55 + 0.45 * broad).lerp(c, patch * 0.35)
            }
            Pattern::Checks => {
                let side = wave(q.x, blur) * wave(q.y, blur);
                a.lerp(b, 0.5 + 0.5 * side)
            }
            Pattern::Stripes(part) => {
                let second = bar(q.y, *part, blur);
                let thin = bar(q.y + 0.37, part * 0.2, blur);
                a.lerp(b, second).lerp(c, thin)
            }
            Pattern::Bricks { aspect, joint, shift } => {
                let row = q.y.floor();
                let x = q.x / aspect + row * shift;
                let one = cell(x.floor() as i32, row as i32, 0, seed);
                let stone = a.lerp(b, one) * (0.85 + 0.3 * fractal(p * 4.0, 3, blur * 4.0, seed));
                let gap = bar(q.y, *joint, blur).max(bar(x, joint / aspect, blur / aspect));
                fade(stone, a.lerp(b, 0.5).lerp(c, joint * 1.5), blur).lerp(c, gap)
            }
            Pattern::Planks { aspect } => {
                let row = q.y.floor();
                let x = q.x / aspect + cell(row as i32, 7, 0, seed);
                let one = cell(x.floor() as i32, row as i32, 1, seed);
                let grain = fractal(Vec3::new(q.x * 0.7 + one * 40.0, q.y * 9.0, row), 4, blur * 9.0, seed);
                let board = a.lerp(b, (0.55 * one + 0.9 * (grain - 0.25)).clamp(0.0, 1.0));
                let gap = bar(q.y, 0.03, blur).max(bar(x, 0.02 / aspect, blur / aspect));
                board.lerp(c, gap * 0.8)
            }
            Pattern::Wood => {
                let bend = fractal(p * Vec3::new(0.5, 1.0, 1.0), 2, blur, seed) * 3.0;
                let across = (p.y * p.y + p.z * p.z).sqrt() * 4.0 + bend;
                let ring = 0.5 + 0.5 * (across * std::f32::consts::TAU).sin() * (1.5 - blur * 8.0).clamp(0.0, 1.0);
                let fibre = fractal(p * Vec3::new(2.0, 30.0, 30.0), 3, blur * 30.0, seed ^ 5);
                a.lerp(b, (0.55 * ring + 0.9 * fibre - 0.2).clamp(0.0, 1.0))
            }
            Pattern::Marble => {
                let warp = fractal(p, 4, blur, seed) * 5.0;
                let vein = 1.0 - ((p.x + p.y * 0.6 + p.z * 0.3) * 2.0 + warp * 2.0).sin().abs();
                a.lerp(c, 0.4 * fractal(p * 2.0, 3, blur * 2.0, seed ^ 2)).lerp(b, vein.powi(5) * 0.8)
            }
            Pattern::Dots(radius) => {
                let centre = q.floor();
                let (x, y) = (centre.x as i32, centre.y as i32);
                let away = (q - centre - 0.5).length();
                let dot = ((radius - away) / blur + 0.5).clamp(0.0, 1.0);
                let colour = if cell(x, y, 2, seed) < 0.25 { c } else { b };
                fade(a.lerp(colour, dot), a.lerp(b, radius * radius * 3.0), blur)
            }
            Pattern::Weave => {
                let over = wave(q.x * 4.0, blur * 4.0) * wave(q.y * 4.0, blur * 4.0);
                let thread = fractal(Vec3::new(q.x * 8.0, q.y * 8.0, 0.0), 2, blur * 8.0, seed);
                let broad = bar(q.x * 0.25, 0.3, blur * 0.25) * 0.5 + bar(q.y * 0.25, 0.3, blur * 0.25) * 0.5;
                a.lerp(b, (0.3 + 0.2 * over + 0.4 * (thread - 0.5)).clamp(0.0, 1.0)).lerp(c, broad * 0.6)
            }
            Pattern::Cells => {
                let (near, second, one) = nearest_cell(q, seed);
                let border = ((second - near) / (blur + 0.08)).clamp(0.0, 1.0);
                let stone = a.lerp(b, one);
                fade(c.lerp(stone, border), a.lerp(b, 0.5), blur)
            }
            Pattern::Text => {
                let line = (q.y * 1.0).floor();
                let word = cell((q.x * 0.5).floor() as i32, line as i32, 3, seed);
                let ends = cell((q.x / 12.0).floor() as i32, line as i32, 4, seed);
                let within = bar(q.y + 0.25, 0.5, blur);
                let letter = cell((q.x * 3.0).floor() as i32, (q.y * 5.0).floor() as i32, line as i32, seed);
                let ink = if letter > 0.45 && word > 0.2 && ends > 0.15 { 1.0 } else { 0.0 };
                let ink = ink + (0.42 - ink) * (blur * 3.0).clamp(0.0, 1.0);
                a.lerp(b, ink * within)
            }
            Pattern::Spines => {
                let place = q.x * 1.0 + 0.35 * cell(q.x.floor() as i32, 0, 9, seed);
                let book = place.floor() as i32;
                let shade = |k| cell(book, 0, k, seed);
                let colour = match (shade(1) * 4.0) as u32 {
                    0 => a,
                    1 => b,
                    2 => c,
                    _ => Vec3::new(shade(2), shade(3), shade(4)) * 0.6,
                };
                let band = bar(q.y * 0.25 + shade(5), 0.12, blur * 0.25);
                let gap = bar(place, 0.06, blur);
                fade(colour.lerp(c, band) * (1.0 - 0.8 * gap), (a + b + c) * 0.25, blur)
            }
            Pattern::Poster => poster(q, self.colours, seed, blur),
            Pattern::Photo(photo) => photo.colour(q, blur),
            Pattern::Wrapped(photo) => photo.wrapped(Vec2::new(p.x, p.y), blur) * a,
        }
    }
}

/// The two coordinates in the plane of a surface: the axis that its normal is nearest to is left out.
fn flat(p: Vec3, normal: Vec3) -> Vec2 {
    let n = normal.abs();
    if n.z >= n.x && n.z >= n.y {
        Vec2::new(p.x, p.y)
    } else if n.x >= n.y {
        Vec2::new(p.y, p.z)
    } else {
        Vec2::new(p.x, p.z)
    }
}

/// 1 in the first `part` of every unit, 0 in the rest, with edges as wide as the blur; its mean where the blur is a unit.
fn bar(x: f32, part: f32, blur: f32) -> f32 {
    let x = x - x.floor();
    let away = (x - part * 0.5).abs().min((x - 1.0 - part * 0.5).abs());
    let sharp = ((part * 0.5 - away) / blur + 0.5).clamp(0.0, 1.0);
    sharp + (part - sharp) * (blur * 2.0 - 1.0).clamp(0.0, 1.0)
}

/// 1 and -1 in turn.
fn wave(x: f32, blur: f32) -> f32 {
    2.0 * bar(x * 0.5, 0.5, blur * 0.5) - 1.0
}

/// Goes over into the mean where the blur is as wide as a unit.
fn fade(colour: Vec3, mean: Vec3, blur: f32) -> Vec3 {
    colour.lerp(mean, (blur * 1.5 - 0.5).clamp(0.0, 1.0))
}

fn contrast(v: f32, by: f32) -> f32 {
    (0.5 + (v - 0.5) * by).clamp(0.0, 1.0)
}

/// Distance to the nearest and to the second nearest point of a jittered grid, and a number of the nearest.
fn nearest_cell(q: Vec2, seed: u32) -> (f32, f32, f32) {
    let floor = q.floor();
    let (mut near, mut second, mut one) = (f32::MAX, f32::MAX, 0.0);
    for dy in -1..=1 {
        for dx in -1..=1 {
            let (x, y) = (floor.x as i32 + dx, floor.y as i32 + dy);
            let point = Vec2::new(x as f32 + cell(x, y, 5, seed), y as f32 + cell(x, y, 6, seed));
            let away = point.distance(q);
            if away < near {
                (near, second, one) = (away, near, cell(x, y, 7, seed));
            } else if away < second {
                second = away;
            }
        }
    }
    (near, second, one)
}

/// Layers of rectangles and discs with gradients, in the unit square about the origin and repeated beyond it.
fn poster(q: Vec2, [a, b, c]: [Vec3; 3], seed: u32, blur: f32) -> Vec3 {
    let tile = (q + 0.5).floor();
    let q = q - tile;
    let draw = |k: i32, j: i32| cell(k, j, tile.x as i32 * 31 + tile.y as i32, seed);
    let mut colour = a.lerp(b, (q.y + 0.5) * draw(0, 9));
    let count = 3 + (draw(0, 1) * 9.0) as i32;
    for k in 1..=count {
        let centre = Vec2::new(draw(k, 0), draw(k, 1)) - 0.5;
        let size = Vec2::new(draw(k, 2), draw(k, 3)) * (0.45 / (1.0 + 0.2 * k as f32)) + 0.02;
        let away = (q - centre).abs();
        let outside = if draw(k, 4) < 0.6 { (away - size).max_element() } else { away.length() - size.x };
        let cover = (-outside / blur + 0.5).clamp(0.0, 1.0);
        let own = Vec3::new(draw(k, 5), draw(k, 6), draw(k, 7));
        let pick = [b, c, own * own, own * 0.3][(draw(k, 8) * 4.0) as usize & 3];
        colour = colour.lerp(pick * (0.8 + 0.4 * (q.y - centre.y)), cover);
    }
    let fine = fractal(q.extend(0.0) * 14.0, 4, blur * 14.0, seed);
    (colour * (0.7 + 0.6 * fine)).max(Vec3::ZERO)
}
