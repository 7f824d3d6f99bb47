//! Looks of real things: colours in the ranges that walls, woods, cloths and leaves have.

use std::sync::Arc;

use glam::Vec3;

use crate::material::{Material, Pattern};
use crate::photo::Photo;
use crate::random::Random;

/// Linear RGB of hue (in turns), saturation and value of sRGB.
pub(crate) fn hsv(hue: f64, saturation: f64, value: f64) -> Vec3 {
    let channel = |shift: f64| {
        let k = (shift + hue * 6.0).rem_euclid(6.0);
        let v = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        crate::lens::linear(v as f32)
    };
    Vec3::new(channel(5.0), channel(3.0), channel(1.0))
}

/// Any colour that a painted or dyed thing has: most are dull.
pub(crate) fn colour(random: &mut Random) -> Vec3 {
    let saturation = if random.chance(0.3) { random.range(0.5, 0.95) } else { random.range(0.0, 0.5) };
    hsv(random.unit(), saturation, random.range(0.15, 0.95))
}

fn near(random: &mut Random, colour: Vec3, by: f64) -> Vec3 {
    let all = random.range(1.0 - by, 1.0 + by) as f32;
    let mut own = || random.range(1.0 - by * 0.3, 1.0 + by * 0.3) as f32;
    (colour * all * Vec3::new(own(), own(), own())).min(Vec3::splat(0.95))
}

fn look(random: &mut Random, pattern: Pattern, colours: [Vec3; 3], scale: f64) -> Material {
    let offset =
        Vec3::new(random.range(-50.0, 50.0) as f32, random.range(-50.0, 50.0) as f32, random.range(-50.0, 50.0) as f32);
    Material {
        pattern,
        colours,
        scale: scale as f32,
        offset,
        seed: random.bits() as u32,
        stain: random.range(0.0, 0.25) as f32,
        ..Material::plain(colours[0])
    }
}

/// What looks are drawn from beside patterns: photographs, where there are some.
#[derive(Debug, Clone, Default)]
pub(crate) struct Photos(pub(crate) Vec<Arc<Photo>>);

impl Photos {
    /// A photograph in place of a pattern, with the given probability.
    fn pick(&self, random: &mut Random, chance: f64) -> Option<Pattern> {
        (!self.0.is_empty() && random.chance(chance)).then(|| Pattern::Photo(Arc::clone(random.pick(&self.0))))
    }
}

/// Paint, plaster, paper, tiles or bricks on a wall.
pub(crate) fn wall(random: &mut Random, photos: &Photos) -> Material {
    let (hue, saturation, value) = (random.unit(), random.range(0.0, 0.35).powi(2) * 3.0, random.range(0.55, 0.97));
    let base = hsv(hue, saturation, value);
    let other = near(random, base, 0.3);
    let dark = near(random, base * 0.5, 0.3);
    if let Some(photo) = photos.pick(random, 0.15) {
        let scale = random.range(0.6, 2.5);
        return look(random, photo, [base, other, dark], scale);
    }
    let colours = [base, other, dark];
    let mut material = match random.weighted(&[5.0, 1.5, 1.0, 1.0, 0.6, 0.8, 0.5]) {
        0 => Material { bump: random.range(0.0, 0.15) as f32, ..look(random, Pattern::Plain, colours, 0.05) },
        1 => look(random, Pattern::Clouds, [base, base * 0.88, dark], 0.7),
        2 => {
            let (part, scale) = (random.range(0.2, 0.6) as f32, random.log_range(0.08, 0.5));
            look(random, Pattern::Stripes(part), colours, scale)
        }
        3 => {
            let pattern = Pattern::Bricks {
                aspect: random.range(1.0, 2.5) as f32,
                joint: 0.04,
                shift: *random.pick(&[0.0, 0.5]),
            };
            let scale = random.log_range(0.1, 0.4);
            Material { rough: 0.25, gloss: 0.05, ..look(random, pattern, [base, base * 0.93, dark], scale) }
        }
        4 => brick(random),
        5 => {
            let (radius, scale) = (random.range(0.1, 0.4) as f32, random.log_range(0.05, 0.3));
            look(random, Pattern::Dots(radius), colours, scale)
        }
        _ => wood(random, true),
    };
    material.rough = material.rough.max(0.25);
    material
}

pub(crate) fn brick(random: &mut Random) -> Material {
    let value = random.range(0.3, 0.75);
    let red = hsv(random.range(0.0, 0.09), random.range(0.25, 0.7), value);
    let (dark, joint) = (near(random, red * 0.6, 0.2), hsv(0.1, 0.08, random.range(0.4, 0.8)));
    let pattern = Pattern::Bricks { aspect: random.range(2.0, 3.5) as f32, joint: 0.12, shift: 0.5 };
    let scale = random.range(0.065, 0.12);
    Material { bump: 0.25, rough: 0.9, ..look(random, pattern, [red, dark, joint], scale) }
}

/// Wood, as boards or as one piece.
pub(crate) fn wood(random: &mut Random, boards: bool) -> Material {
    let (hue, saturation, value) = (random.range(0.04, 0.11), random.range(0.25, 0.7), random.range(0.2, 0.85));
    let light = hsv(hue, saturation, value);
    let dark = hsv(hue - 0.01, saturation, value * random.range(0.5, 0.85));
    let colours = [light, dark, dark * 0.25];
    let gloss = random.range(0.02, 0.07) as f32;
    let rough = random.range(0.2, 0.8) as f32;
    let (pattern, scale) = if boards {
        (Pattern::Planks { aspect: random.range(5.0, 14.0) as f32 }, random.range(0.07, 0.22))
    } else {
        (Pattern::Wood, random.range(0.08, 0.3))
    };
    Material { gloss, rough, ..look(random, pattern, colours, scale) }
}

/// Boards, tiles, stone or carpet.
pub(crate) fn floor(random: &mut Random, photos: &Photos) -> Material {
    let saturation = if random.chance(0.2) { random.range(0.1, 0.5) } else { random.range(0.0, 0.22) };
    let base = hsv(random.unit(), saturation, random.range(0.2, 0.85));
    let (other, dark) = (near(random, base, 0.35), near(random, base * 0.45, 0.2));
    let colours = [base, other, dark];
    if let Some(photo) = photos.pick(random, 0.15) {
        let scale = random.range(0.5, 2.0);
        return look(random, photo, colours, scale);
    }
    match random.weighted(&[4.0, 2.0, 2.0, 0.7, 0.7, 0.5]) {
        0 => wood(random, true),
        1 => {
            let pattern = Pattern::Bricks {
                aspect: *random.pick(&[1.0, 1.0, 2.0]),
                joint: 0.025,
                shift: *random.pick(&[0.0, 0.5]),
            };
            let (scale, rough) = (random.range(0.2, 0.7), random.range(0.1, 0.5) as f32);
            let other = near(random, base, 0.1);
            Material { rough, gloss: 0.05, ..look(random, pattern, [base, other, dark], scale) }
        }
        2 => {
            let scale = random.log_range(0.01, 0.03);
            Material { rough: 1.0, gloss: 0.0, bump: 0.3, ..look(random, Pattern::Grains, colours, scale) }
        }
        3 => {
            let scale = random.range(0.2, 0.5);
            Material { rough: 0.2, ..look(random, Pattern::Checks, [base, dark, dark], scale) }
        }
        4 => {
            let scale = random.range(0.5, 1.5);
            Material { rough: 0.15, gloss: 0.06, ..look(random, Pattern::Marble, colours, scale) }
        }
        _ => {
            let scale = random.log_range(0.02, 0.3);
            look(random, Pattern::Cells, colours, scale)
        }
    }
}

/// Cloth of furniture, curtains and clothes.
pub(crate) fn cloth(random: &mut Random, photos: &Photos) -> Material {
    let base = colour(random);
    let colours = [base, near(random, base * 0.7, 0.3), colour(random)];
    let (part, radius) = (random.range(0.1, 0.6) as f32, random.range(0.15, 0.4) as f32);
    if let Some(photo) = photos.pick(random, 0.12) {
        let scale = random.range(0.3, 1.0);
        return look(random, photo, colours, scale);
    }
    let (pattern, scale) = match random.weighted(&[4.0, 2.0, 2.0, 1.0, 1.0, 1.0]) {
        0 => (Pattern::Grains, random.log_range(0.01, 0.05)),
        1 => (Pattern::Weave, random.log_range(0.02, 0.08)),
        2 => (Pattern::Stripes(part), random.log_range(0.02, 0.15)),
        3 => (Pattern::Dots(radius), random.log_range(0.02, 0.1)),
        4 => (Pattern::Clouds, random.log_range(0.05, 0.3)),
        _ => (Pattern::Checks, random.log_range(0.02, 0.12)),
    };
    Material { rough: 1.0, gloss: 0.0, bump: 0.2, ..look(random, pattern, colours, scale) }
}

/// Plastic, paint or lacquer.
pub(crate) fn paint(random: &mut Random) -> Material {
    let base = colour(random);
    let rough = random.range(0.08, 0.7) as f32;
    let gloss = random.range(0.03, 0.06) as f32;
    let other = near(random, base, 0.2);
    Material { rough, gloss, ..look(random, Pattern::Plain, [base, other, other * 0.5], 1.0) }
}

pub(crate) fn white(random: &mut Random) -> Material {
    let base = hsv(random.range(0.05, 0.2), random.range(0.0, 0.1), random.range(0.75, 0.96));
    Material { rough: random.range(0.3, 0.9) as f32, ..look(random, Pattern::Plain, [base; 3], 1.0) }
}

pub(crate) fn metal(random: &mut Random) -> Material {
    let base = hsv(random.range(0.05, 0.6), random.range(0.0, 0.12), random.range(0.3, 0.7));
    let (gloss, rough) = (random.range(0.3, 0.6) as f32, random.range(0.12, 0.5) as f32);
    Material { gloss, rough, ..look(random, Pattern::Plain, [base * 0.5; 3], 1.0) }
}

/// A thing's surface of any kind.
pub(crate) fn any(random: &mut Random, photos: &Photos) -> Material {
    let colours = [colour(random), colour(random), colour(random)];
    if let Some(photo) = photos.pick(random, 0.3) {
        let scale = random.log_range(0.1, 1.0);
        return look(random, photo, colours, scale);
    }
    let part = random.range(0.1, 0.6) as f32;
    match random.weighted(&[3.0, 1.5, 1.0, 1.5, 1.0, 4.0, 1.5, 1.5]) {
        0 => paint(random),
        1 => wood(random, false),
        2 => metal(random),
        3 => cloth(random, photos),
        4 => {
            let scale = random.log_range(0.1, 0.6);
            look(random, Pattern::Marble, colours, scale)
        }
        5 => {
            let pattern = match random.below(6) {
                0 => Pattern::Checks,
                1 => Pattern::Stripes(part),
                2 => Pattern::Dots(part),
                3 => Pattern::Cells,
                4 => Pattern::Clouds,
                _ => Pattern::Bricks { aspect: 1.0 + 3.0 * part, joint: 0.05, shift: 0.5 },
            };
            let scale = random.log_range(0.02, 0.3);
            Material { rough: random.range(0.1, 1.0) as f32, ..look(random, pattern, colours, scale) }
        }
        6 => poster(random, photos, 0.2, 0.2),
        _ => white(random),
    }
}

/// A printed picture of this width and height in metres.
pub(crate) fn poster(random: &mut Random, photos: &Photos, width: f64, height: f64) -> Material {
    let colours = [colour(random), colour(random), colour(random)];
    let pattern = photos.pick(random, 0.7).unwrap_or(Pattern::Poster);
    let rough = random.range(0.1, 0.9) as f32;
    Material { stain: 0.0, rough, offset: Vec3::ZERO, ..look(random, pattern, colours, width.max(height)) }
}

pub(crate) fn text(random: &mut Random) -> Material {
    let paper = hsv(0.12, random.range(0.0, 0.15), random.range(0.8, 0.97));
    let scale = random.range(0.008, 0.02);
    look(random, Pattern::Text, [paper, paper * 0.08, paper], scale)
}

pub(crate) fn spines(random: &mut Random, thickness: f64) -> Material {
    let colours = [colour(random), colour(random), colour(random)];
    look(random, Pattern::Spines, colours, thickness)
}

pub(crate) fn leaves(random: &mut Random) -> Material {
    let hue = random.range(0.17, 0.36);
    let base = hsv(hue, random.range(0.35, 0.75), random.range(0.2, 0.6));
    let other = hsv(hue - 0.04, random.range(0.3, 0.7), random.range(0.3, 0.7));
    let scale = random.log_range(0.05, 0.5);
    Material { gloss: 0.02, ..look(random, Pattern::Clouds, [base, other, base * 0.5], scale) }
}

/// Grass, earth, sand, gravel or snow.
pub(crate) fn ground(random: &mut Random) -> Material {
    let (hue, saturation, value) = match random.weighted(&[4.0, 2.0, 2.0, 0.7]) {
        0 => (random.range(0.18, 0.32), random.range(0.3, 0.65), random.range(0.25, 0.55)),
        1 => (random.range(0.05, 0.11), random.range(0.25, 0.6), random.range(0.25, 0.6)),
        2 => (random.range(0.09, 0.14), random.range(0.2, 0.45), random.range(0.5, 0.8)),
        _ => (0.6, 0.03, random.range(0.8, 0.95)),
    };
    let base = hsv(hue, saturation, value);
    let other = hsv(hue - 0.05, saturation * 0.8, value * random.range(0.5, 1.3).min(1.0 / value));
    let scale = random.log_range(0.1, 1.2);
    Material { gloss: 0.0, bump: 0.4, ..look(random, Pattern::Grains, [base, other, other * 0.6], scale) }
}

/// Asphalt, concrete, paving.
pub(crate) fn pavement(random: &mut Random) -> Material {
    let grey = hsv(random.range(0.05, 0.65), random.range(0.0, 0.1), random.range(0.25, 0.7));
    let other = near(random, grey, 0.25);
    let colours = [grey, other, grey * 0.45];
    match random.below(4) {
        0 => {
            let pattern = Pattern::Bricks { aspect: random.range(1.0, 2.2) as f32, joint: 0.05, shift: 0.5 };
            let scale = random.log_range(0.1, 0.6);
            look(random, pattern, colours, scale)
        }
        1 => {
            let scale = random.log_range(0.08, 0.3);
            look(random, Pattern::Cells, colours, scale)
        }
        _ => {
            let scale = random.log_range(0.03, 0.15);
            Material { bump: 0.2, ..look(random, Pattern::Grains, colours, scale) }
        }
    }
}

pub(crate) fn skin(random: &mut Random) -> Material {
    let base = hsv(random.range(0.03, 0.08), random.range(0.25, 0.6), random.range(0.3, 0.9));
    Material { stain: 0.1, ..look(random, Pattern::Plain, [base; 3], 1.0) }
}

pub(crate) fn glowing(colour: Vec3, strength: f32) -> Material {
    Material { glow: strength, gloss: 0.0, ..Material::plain(colour) }
}
