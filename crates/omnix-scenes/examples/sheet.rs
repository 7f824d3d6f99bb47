//! A contact sheet: one row for each sample with its images, the depth of the first, what moves in it, and trails of its points.
//!
//! `cargo run -p omnix-scenes --example sheet -- OUT.png [first index] [rows] [width] [height] [recipe.toml] [assets]`
//! prints seconds a sample.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use image::{Rgb, RgbImage};
use omnix_data::{Flag, Sample};
use omnix_scenes::{Assets, Recipe, Samples};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: usize| arguments.get(k).map_or(Ok(default), |text| text.parse());
    let out = arguments.first().ok_or("the name of a picture to write is missing")?;
    let (first, rows) = (number(1, 0)? as u64, number(2, 12)? as u32);
    let size = [number(3, 140)?, number(4, 84)?];
    let recipe = match arguments.get(5) {
        Some(path) => Recipe::parse(&std::fs::read_to_string(path)?)?,
        None => Recipe::default(),
    };
    let assets = arguments.get(6).map_or_else(|| Ok(Assets::default()), |path| Assets::read(Path::new(path)))?;
    for note in &assets.notes {
        eprintln!("{note}");
    }
    let samples = Samples { recipe, assets, size, images: 4, visibility: false, seed: 24 };
    let [width, height] = size.map(|v| v as u32);
    let mut sheet = RgbImage::new(7 * (width + 2), rows * (height + 2));
    let mut seconds = Vec::new();
    for row in 0..rows {
        let begin = Instant::now();
        let sample = samples.get(first + u64::from(row))?;
        seconds.push(begin.elapsed().as_secs_f64());
        let mut put = |column: u32, picture: &RgbImage| {
            image::imageops::replace(
                &mut sheet,
                picture,
                i64::from(column * (width + 2)),
                i64::from(row * (height + 2)),
            );
        };
        for k in 0..4 {
            let colours = sample.image(k).to_vec();
            put(k as u32, &RgbImage::from_raw(width, height, colours).ok_or("an image of another size")?);
        }
        put(4, &depth(&sample, width, height));
        put(5, &moving(&sample, width, height));
        put(6, &trails(&sample, width, height));
    }
    sheet.save(out)?;
    seconds.sort_by(f64::total_cmp);
    let mean = seconds.iter().sum::<f64>() / seconds.len() as f64;
    let last = seconds.len() - 1;
    eprintln!("seconds a sample: mean {mean:.3}, median {:.3}, most {:.3}", seconds[last / 2], seconds[last]);
    Ok(())
}

/// Near is bright, by the logarithm of depth between its 2nd and 98th percentiles.
fn depth(sample: &Sample, width: u32, height: u32) -> RgbImage {
    let depth = sample.depth(0).unwrap_or_default();
    let mut known: Vec<f32> = depth.iter().copied().filter(|d| d.is_finite()).collect();
    known.sort_by(f32::total_cmp);
    let rank = |part: usize| known.get(known.len() * part / 100).map_or(1.0, |d| d.ln());
    let (near, far) = (rank(2), rank(98));
    RgbImage::from_fn(width, height, |x, y| {
        let d = depth[(y * width + x) as usize];
        let s = 1.0 - ((d.ln() - near) / (far - near).max(1e-6)).clamp(0.0, 1.0);
        let channel = |middle: f32| ((1.0 - (s - middle).abs() * 2.2).clamp(0.0, 1.0) * 255.0) as u8;
        if d.is_finite() { Rgb([channel(0.85), channel(0.5), channel(0.15)]) } else { Rgb([0; 3]) }
    })
}

fn moving(sample: &Sample, width: u32, height: u32) -> RgbImage {
    let (flags, image) = (sample.moving(0).unwrap_or_default(), sample.image(0));
    RgbImage::from_fn(width, height, |x, y| {
        let k = (y * width + x) as usize;
        let grey = image[3 * k + 1] / 3;
        if flags[k] == Flag::Yes { Rgb([255, 160, grey]) } else { Rgb([grey; 3]) }
    })
}

/// Where points of the first image go in the first camera, moving ones only.
fn trails(sample: &Sample, width: u32, height: u32) -> RgbImage {
    let image = sample.image(0);
    let mut picture = RgbImage::from_fn(width, height, |x, y| {
        let k = 3 * (y * width + x) as usize;
        Rgb([image[k] / 2, image[k + 1] / 2, image[k + 2] / 2])
    });
    let flags = sample.moving(0).unwrap_or_default();
    let camera = &sample.cameras()[0];
    let project = |p: [f32; 3]| {
        let row = |k: usize| {
            let e = camera.extrinsics[k];
            e[0] * p[0] + e[1] * p[1] + e[2] * p[2] + e[3]
        };
        let (x, y, z) = (row(0), row(1), row(2));
        let k = camera.intrinsics;
        (z > 0.0).then(|| (x / z * k[0][0] + k[0][2], y / z * k[1][1] + k[1][2]))
    };
    for y in (2..height).step_by(4) {
        for x in (2..width).step_by(4) {
            let k = (y * width + x) as usize;
            if flags[k] != Flag::Yes {
                continue;
            }
            let path: Vec<_> = (0..4).filter_map(|t| project(sample.positions(0, t)?[k])).collect();
            for pair in path.windows(2) {
                for s in 0..=20 {
                    let s = s as f32 / 20.0;
                    let (u, v) = (pair[0].0 + (pair[1].0 - pair[0].0) * s, pair[0].1 + (pair[1].1 - pair[0].1) * s);
                    if u >= 0.0 && v >= 0.0 && (u as u32) < width && (v as u32) < height {
                        picture.put_pixel(u as u32, v as u32, Rgb([255, (90.0 + 160.0 * s) as u8, 60]));
                    }
                }
            }
        }
    }
    picture
}
