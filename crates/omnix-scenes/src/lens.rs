//! From light to the bytes of a picture: exposure, tone curve, vignette, sensor noise, gamma.

use glam::Vec3;
use rayon::prelude::*;

use crate::random::mix;

/// How a camera makes a picture of light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Film {
    /// Stops above or below the exposure that a camera would choose.
    pub(crate) bias: f32,
    /// Gains of red and blue: white balance.
    pub(crate) balance: [f32; 2],
    /// Standard deviation of the noise, in parts of white.
    pub(crate) noise: f32,
    /// Darkening at the corners.
    pub(crate) vignette: f32,
    /// Exponent of contrast about middle grey.
    pub(crate) contrast: f32,
    /// Width of the lens's blur in pixels.
    pub(crate) blur: f32,
    /// Quality of the JPEG that the picture has been, if it has.
    pub(crate) jpeg: Option<u8>,
    pub(crate) seed: u64,
}

/// Of sRGB in [0, 1].
pub(crate) fn linear(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn encoded(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// The gain that brings a picture's middle to middle grey: from the mean of logarithms, and so that few pixels are white.
pub(crate) fn exposure(light: &[Vec3]) -> f32 {
    let luminance = |c: &Vec3| 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
    // Few enough for a sort at no cost.
    let step = (light.len() / 2000).max(1);
    let mut values: Vec<f32> = light.iter().step_by(step).map(luminance).map(|v| v.max(1e-5)).collect();
    if values.is_empty() {
        return 1.0;
    }
    values.sort_by(f32::total_cmp);
    let mean = (values.iter().map(|v| v.ln()).sum::<f32>() / values.len() as f32).exp();
    let bright = values[values.len() * 95 / 100];
    (0.16 / mean).min(1.6 / bright)
}

impl Film {
    /// RGB bytes, row by row.
    pub(crate) fn develop(&self, light: &[Vec3], width: usize) -> Vec<u8> {
        let gain = exposure(light) * self.bias.exp2();
        let balance = Vec3::new(self.balance[0], 1.0, self.balance[1]) * gain;
        let height = light.len() / width.max(1);
        let blurred;
        let light = if self.blur > 0.05 {
            blurred = blur(light, width, self.blur);
            &blurred
        } else {
            light
        };
        let pixel = |index: usize| {
            let x = (index % width) as f32 / width as f32 - 0.5;
            let y = ((index / width) as f32 / height as f32 - 0.5) * height as f32 / width as f32;
            let corner = 1.0 - self.vignette * (x * x + y * y) * 3.0;
            let light = light[index] * balance * corner;
            let bits = mix(self.seed ^ (index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            let grey = centred(bits);
            [light.x, light.y, light.z].map({
                let mut channel = 0;
                move |v| {
                    channel += 1;
                    let own = centred(mix(bits ^ channel));
                    // Shot noise grows with the root of the light.
                    let noise = self.noise * (0.3 + v.max(0.0).sqrt()) * (0.6 * grey + 0.6 * own);
                    let toned = encoded(shoulder((v + noise).max(0.0)));
                    let toned = 0.45 + (toned - 0.45) * self.contrast;
                    (toned.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
                }
            })
        };
        (0..light.len()).into_par_iter().map(pixel).collect::<Vec<[u8; 3]>>().into_flattened()
    }
}

/// About normal, mean 0, standard deviation 1: the sum of four bytes' uniform numbers.
fn centred(bits: u64) -> f32 {
    let sum: u64 = (0..4).map(|k| bits >> (16 * k) & 0xffff).sum();
    (sum as f32 / 65_535.0 - 2.0) * 1.732
}

/// Linear up to 0.7, then ever flatter towards 1.
fn shoulder(v: f32) -> f32 {
    const KNEE: f32 = 0.7;
    if v <= KNEE { v } else { KNEE + (1.0 - KNEE) * (1.0 - (-(v - KNEE) / (1.0 - KNEE)).exp()) }
}

/// A small blur of three pixels a side, first along rows, then along columns.
fn blur(light: &[Vec3], width: usize, by: f32) -> Vec<Vec3> {
    let side = (by * 0.3).min(0.33);
    let height = light.len() / width;
    let mix = |a: Vec3, b: Vec3, c: Vec3| b * (1.0 - 2.0 * side) + (a + c) * side;
    let along = |index: usize| {
        let (y, x) = (index / width, index % width);
        let row = y * width;
        mix(light[row + x.saturating_sub(1)], light[index], light[row + (x + 1).min(width - 1)])
    };
    let rows: Vec<Vec3> = (0..light.len()).into_par_iter().map(along).collect();
    let across = |index: usize| {
        let (y, x) = (index / width, index % width);
        mix(rows[y.saturating_sub(1) * width + x], rows[index], rows[(y + 1).min(height - 1) * width + x])
    };
    (0..light.len()).into_par_iter().map(across).collect()
}
