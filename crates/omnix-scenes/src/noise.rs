//! Smooth noise over space, for patterns and shapes.
//!
//! Value noise: random numbers at whole-number points (a hash of the coordinates and a seed), blended with the smoothstep
//! polynomial. Fractal sums have octaves of half the size and half the weight each and stop where an octave is finer than the
//! pixel that looks at it.

use glam::Vec3;

/// 32 well mixed bits of a lattice point (constants of "lowbias32").
#[inline]
fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let h = seed
        ^ (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    let h = (h ^ h >> 16).wrapping_mul(0x7feb_352d);
    let h = (h ^ h >> 15).wrapping_mul(0x846c_a68b);
    h ^ h >> 16
}

/// A number in [0, 1) of a lattice point.
#[inline]
pub(crate) fn cell(x: i32, y: i32, z: i32, seed: u32) -> f32 {
    (hash(x, y, z, seed) >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Noise in [0, 1], of features about one unit in size.
pub(crate) fn noise(p: Vec3, seed: u32) -> f32 {
    let floor = p.floor();
    let f = p - floor;
    let w = f * f * (Vec3::splat(3.0) - 2.0 * f);
    let (x, y, z) = (floor.x as i32, floor.y as i32, floor.z as i32);
    let at = |dx: i32, dy: i32, dz: i32| cell(x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz), seed);
    let blend = |a: f32, b: f32, w: f32| a + (b - a) * w;
    let plane = |dz| blend(blend(at(0, 0, dz), at(1, 0, dz), w.x), blend(at(0, 1, dz), at(1, 1, dz), w.x), w.y);
    blend(plane(0), plane(1), w.z)
}

/// Fractal noise about [0, 1], mean 0.5; octaves finer than `footprint` (in the units of `p`) are left at their mean.
pub(crate) fn fractal(mut p: Vec3, octaves: u32, footprint: f32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut width) = (0.0, 0.5, 0.0, footprint);
    for octave in 0..octaves {
        let keep = (1.5 - width).clamp(0.0, 1.0);
        let value = if keep > 0.0 { 0.5 + (noise(p, seed.wrapping_add(octave)) - 0.5) * keep } else { 0.5 };
        sum += weight * value;
        total += weight;
        weight *= 0.55;
        width *= 2.03;
        p = p * 2.03 + Vec3::new(17.3, -9.1, 5.7);
    }
    0.5 + (sum / total - 0.5) * 1.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_fades_where_it_is_too_fine() {
        let at = |x: f32, footprint| fractal(Vec3::new(x, 0.3, -2.7), 5, footprint, 9);
        for k in 0..400 {
            let x = k as f32 * 0.05 - 10.0;
            assert!((at(x, 0.0) - at(x + 1e-3, 0.0)).abs() < 0.03, "a jump at {x}");
            assert_eq!(at(x, 10.0), 0.5, "at {x}");
        }
        let spread = (0..400).map(|k| at(k as f32 * 0.37, 0.0));
        assert!(spread.clone().fold(0.0, f32::max) > 0.7 && spread.fold(1.0, f32::min) < 0.3);
    }
}
