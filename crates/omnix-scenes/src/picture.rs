//! One picture of a scene.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder as _, ImageFormat};

use crate::cast::{Geometry, Hit};
use crate::lens::Film;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::scene::Scene;
use crate::shade::{Shading, shade};
use crate::smear::{Later, smear};
use crate::view::View;

/// RGB of one picture, row by row, from its hits; `seed` is that of its noise. Blurred by motion where a later state is given.
pub(crate) fn draw(
    scene: &Scene,
    geometry: &Geometry,
    view: &View,
    hits: &[Option<Hit>],
    later: Option<&Later>,
    film: &Film,
    seed: u64,
) -> Vec<u8> {
    let shading = Shading { geometry, materials: &scene.materials, light: &scene.light, seed };
    let mut light = shade(shading, view, hits);
    if let Some(later) = later {
        light = smear(&light, view, hits, later);
    }
    let colours = Film { seed, ..*film }.develop(&light, view.size[0]);
    match film.jpeg {
        Some(quality) => packed(&colours, view.size, quality).unwrap_or(colours),
        None => colours,
    }
}

/// What a JPEG of this quality leaves of a picture; nothing where it cannot be one.
fn packed(colours: &[u8], [width, height]: [usize; 2], quality: u8) -> Option<Vec<u8>> {
    let mut file = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut file, quality);
    encoder.write_image(colours, width as u32, height as u32, ExtendedColorType::Rgb8).ok()?;
    let picture = image::load_from_memory_with_format(&file, ImageFormat::Jpeg).ok()?;
    Some(picture.into_rgb8().into_raw())
}

/// The film of one camera.
pub(crate) fn film(random: &mut Random, recipe: &Recipe) -> Film {
    let [low, high] = recipe.noise;
    Film {
        bias: (random.normal() * 0.35) as f32,
        balance: [(1.0 + random.normal() * 0.06) as f32, (1.0 + random.normal() * 0.08) as f32],
        // Mostly little.
        noise: (low + (high - low) * random.unit().powi(2)) as f32,
        vignette: if random.chance(0.5) { random.range(0.0, 0.5) as f32 } else { 0.0 },
        contrast: random.range(0.85, 1.2) as f32,
        blur: random.range(-0.5, 1.0).max(0.0) as f32,
        jpeg: random.chance(recipe.jpeg).then(|| random.range(40.0, 96.0) as u8),
        seed: 0,
    }
}
