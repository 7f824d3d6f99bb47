//! Colours changed at random, alike in all images of a sample (`spec/omnix.md` 11.3), as a function of (seed, index).
//!
//! With probability 0.9 torchvision's colour jitter: brightness, contrast and saturation by factors in [0.5, 1.5), hue turned by [-0.1, 0.1)
//! of a circle, in a random order; then with probability 0.05 grey. As torchvision computes on float images of 0 to 1: each step blends with black,
//! with the mean grey of the image, or with each pixel's grey, and is clamped; hue goes through HSV. Rounded once, at the end.

use rayon::prelude::*;

use crate::random::Random;
use crate::{DataError, Sample};

/// Share of samples whose colours are changed, and that become grey.
const JITTER: f64 = 0.9;
const GREY: f64 = 0.05;
/// Range of the factors about 1, and of the turn of the hue.
const FACTOR: f64 = 0.5;
const TURN: f64 = 0.1;
/// What the random numbers are for.
const PURPOSE: u64 = 2;

/// One step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Times this.
    Brightness(f32),
    /// Away from the image's mean grey, times this.
    Contrast(f32),
    /// Away from the pixel's grey, times this.
    Saturation(f32),
    /// Turned by this share of the circle of hues.
    Hue(f32),
    /// Grey.
    Grey,
}

/// The steps of sample `index`, in their order.
#[must_use]
pub fn draw_colours(seed: u64, index: u64) -> Vec<Step> {
    let mut random = Random::new(seed, index, PURPOSE);
    let mut steps = Vec::new();
    if random.unit() < JITTER {
        let order = random.some(4, 4);
        let mut factor = || random.between(1.0 - FACTOR, 1.0 + FACTOR) as f32;
        let (brightness, contrast, saturation) = (factor(), factor(), factor());
        let hue = random.between(-TURN, TURN) as f32;
        let all =
            [Step::Brightness(brightness), Step::Contrast(contrast), Step::Saturation(saturation), Step::Hue(hue)];
        steps.extend(order.into_iter().map(|k| all[k]));
    }
    if random.unit() < GREY {
        steps.push(Step::Grey);
    }
    steps
}

/// Changes the colours of all images of a sample by the same steps.
///
/// # Errors
/// None of a sample that was valid.
pub fn colour(sample: Sample, steps: &[Step]) -> Result<Sample, DataError> {
    let mut parts = sample.into_parts();
    let bytes = parts.size[0] as usize * parts.size[1] as usize * 3;
    parts.images.par_chunks_mut(bytes).for_each(|image| colour_image(image, steps));
    Sample::new(parts)
}

/// Changes the colours of one image, `[H][W][3]`.
fn colour_image(image: &mut [u8], steps: &[Step]) {
    if steps.is_empty() {
        return;
    }
    let mut pixels: Vec<[f32; 3]> = image.as_chunks::<3>().0.iter().map(|p| p.map(|v| f32::from(v) / 255.0)).collect();
    for step in steps {
        match *step {
            Step::Brightness(by) => pixels.iter_mut().for_each(|p| *p = blend(*p, [0.0; 3], by)),
            Step::Contrast(by) => {
                let sum: f64 = pixels.iter().map(|p| f64::from(grey(*p))).sum();
                let mean = (sum / pixels.len().max(1) as f64) as f32;
                pixels.iter_mut().for_each(|p| *p = blend(*p, [mean; 3], by));
            }
            Step::Saturation(by) => pixels.iter_mut().for_each(|p| *p = blend(*p, [grey(*p); 3], by)),
            Step::Hue(by) => pixels.iter_mut().for_each(|p| *p = turn(*p, by)),
            Step::Grey => pixels.iter_mut().for_each(|p| *p = [grey(*p); 3]),
        }
    }
    for (out, pixel) in image.as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
        *out = pixel.map(|v| (v * 255.0).round() as u8);
    }
}

fn blend(a: [f32; 3], b: [f32; 3], by: f32) -> [f32; 3] {
    std::array::from_fn(|k| (by * a[k] + (1.0 - by) * b[k]).clamp(0.0, 1.0))
}

fn grey([r, g, b]: [f32; 3]) -> f32 {
    0.2989 * r + 0.587 * g + 0.114 * b
}

/// The hue turned, saturation and value kept.
fn turn([r, g, b]: [f32; 3], by: f32) -> [f32; 3] {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let range = most - least;
    if range == 0.0 {
        return [r, g, b];
    }
    let sector = if most == r {
        (g - b) / range
    } else if most == g {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    let hue = (sector / 6.0 + by).rem_euclid(1.0) * 6.0;
    let whole = hue.floor();
    let part = hue - whole;
    let saturation = range / most;
    let value = |v: f32| v.clamp(0.0, 1.0);
    let p = value(most * (1.0 - saturation));
    let q = value(most * (1.0 - saturation * part));
    let t = value(most * (1.0 - saturation * (1.0 - part)));
    match whole as u32 % 6 {
        0 => [most, t, p],
        1 => [q, most, p],
        2 => [p, most, t],
        3 => [p, q, most],
        4 => [t, p, most],
        _ => [most, p, q],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    fn pixels(image: &[u8], steps: &[Step]) -> Vec<u8> {
        let mut out = image.to_vec();
        colour_image(&mut out, steps);
        out
    }

    #[test]
    fn steps_do_what_torchvision_does() {
        let image = [200, 100, 50, 10, 20, 30];
        assert_eq!(pixels(&image, &[Step::Brightness(1.5)]), [255, 150, 75, 15, 30, 45]);
        // Greys 124.18 and 18.15, their mean 71.16.
        assert_eq!(pixels(&image, &[Step::Contrast(0.5)]), [136, 86, 61, 41, 46, 51]);
        assert_eq!(pixels(&image, &[Step::Saturation(0.5)]), [162, 112, 87, 14, 19, 24]);
        assert_eq!(pixels(&image, &[Step::Grey]), [124, 124, 124, 18, 18, 18]);
        // A third of the circle: red goes to green, green to blue.
        assert_eq!(pixels(&[200, 0, 0, 10, 10, 10], &[Step::Hue(1.0 / 3.0)]), [0, 200, 0, 10, 10, 10]);
        assert_eq!(pixels(&image, &[Step::Hue(1.0)]), image);
        assert_eq!(pixels(&image, &[]), image);
    }

    #[test]
    fn draws_are_functions_within_their_ranges() {
        let mut counts = [0; 2];
        let mut orders = std::collections::BTreeSet::new();
        for index in 0..4000 {
            let steps = draw_colours(9, index);
            assert_eq!(steps, draw_colours(9, index));
            counts[0] += usize::from(steps.len() >= 4);
            counts[1] += usize::from(steps.last() == Some(&Step::Grey));
            for step in &steps {
                match step {
                    Step::Brightness(f) | Step::Contrast(f) | Step::Saturation(f) => assert!((0.5..=1.5).contains(f)),
                    Step::Hue(f) => assert!(f.abs() <= 0.1),
                    Step::Grey => {}
                }
            }
            let names: String = steps.iter().map(|step| format!("{step:?}").remove(0)).collect();
            orders.insert(names.replace('G', ""));
        }
        assert!((3500..3700).contains(&counts[0]) && (150..250).contains(&counts[1]), "{counts:?}");
        // All 24 orders, and none at all.
        assert_eq!(orders.len(), 25);
    }

    #[test]
    fn all_images_get_the_same_and_nothing_else_changes() {
        let sample = made::video([14, 14], 2);
        let steps = draw_colours(1, 3);
        let changed = colour(sample.clone(), &steps).unwrap();
        for image in 0..2 {
            assert_eq!(changed.image(image), pixels(sample.image(image), &steps));
        }
        assert_eq!(
            (changed.parts().depth.as_ref(), changed.motion()),
            (sample.parts().depth.as_ref(), sample.motion())
        );
    }
}
