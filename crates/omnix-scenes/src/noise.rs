//! Smooth noise over space, for patterns and shapes.
//!
//! Value noise: random numbers at whole-number points (a hash of the coordinates and a seed), blended with the smoothstep
//! polynomial. Fractal sums have octaves of half the size and half the weight each and stop where an octave is finer than the
//! pixel that looks at it.

use glam::Vec3;

/// What the coordinates of a lattice point are multiplied with.
const FACTORS: [u32; 3] = [0x8da6_b343, 0xd816_3841, 0xcb1a_b31f];

/// A number in [0, 1) of 32 bits, mixed well (constants of "lowbias32").
#[inline]
fn mixed(h: u32) -> f32 {
    let h = (h ^ h >> 16).wrapping_mul(0x7feb_352d);
    let h = (h ^ h >> 15).wrapping_mul(0x846c_a68b);
    ((h ^ h >> 16) >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A number in [0, 1) of a lattice point.
#[inline]
pub(crate) fn cell(x: i32, y: i32, z: i32, seed: u32) -> f32 {
    let [a, b, c] = FACTORS;
    mixed(seed ^ (x as u32).wrapping_mul(a) ^ (y as u32).wrapping_mul(b) ^ (z as u32).wrapping_mul(c))
}

/// Noise in [0, 1], of features about one unit in size.
pub(crate) fn noise(p: Vec3, seed: u32) -> f32 {
    let floor = p.floor();
    let f = p - floor;
    let w = f * f * (Vec3::splat(3.0) - 2.0 * f);
    // `cell` of the eight corners: products of neighbours differ by the factor.
    let products = |v: f32, factor: u32| {
        let product = (v as i32 as u32).wrapping_mul(factor);
        [product, product.wrapping_add(factor)]
    };
    let [a, b, c] = FACTORS;
    let (x, y, z) = (products(floor.x, a), products(floor.y, b), products(floor.z, c));
    let at = |dx: usize, dy: usize, dz: usize| mixed(seed ^ x[dx] ^ y[dy] ^ z[dz]);
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
    fn noise_at_a_lattice_point_is_the_number_of_its_cell() {
        for (x, y, z) in [(0, 0, 0), (3, -2, 7), (-1, -1, -1), (1000, -40_000, 5)] {
            assert_eq!(noise(Vec3::new(x as f32, y as f32, z as f32), 9), cell(x, y, z, 9));
            // From the other side of each coordinate: the second of a product's pair.
            let below = Vec3::new((x as f32).next_down(), (y as f32).next_down(), (z as f32).next_down());
            assert!((noise(below, 9) - cell(x, y, z, 9)).abs() < 1e-2, "{x} {y} {z}");
        }
    }

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
