//! Colour maps: Spectral for depth, hues for cameras, sRGB to linear for glTF.

use std::sync::OnceLock;

use super::sample::percentile;

/// ColorBrewer's Spectral, eleven classes, as matplotlib stores it (Cynthia Brewer, Apache-2.0).
const ANCHORS: [[f64; 3]; 11] = [
    [158.0, 1.0, 66.0],
    [213.0, 62.0, 79.0],
    [244.0, 109.0, 67.0],
    [253.0, 174.0, 97.0],
    [254.0, 224.0, 139.0],
    [255.0, 255.0, 191.0],
    [230.0, 245.0, 152.0],
    [171.0, 221.0, 164.0],
    [102.0, 194.0, 165.0],
    [50.0, 136.0, 189.0],
    [94.0, 79.0, 162.0],
];

/// matplotlib's Spectral at `x` in 0..1 (red to violet), 256 steps, truncated to 8 bits. Values outside are clamped.
#[must_use]
pub fn spectral(x: f32) -> [u8; 3] {
    static TABLE: OnceLock<[[u8; 3]; 256]> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        std::array::from_fn(|i| {
            let at = i as f64 / 255.0 * 10.0;
            let low = (at as usize).min(9);
            let part = at - low as f64;
            // The margin keeps exact anchor values from losing a level to the last bit of the interpolation.
            std::array::from_fn(|c| (ANCHORS[low][c] + part * (ANCHORS[low + 1][c] - ANCHORS[low][c]) + 1e-9) as u8)
        })
    });
    // `as` sends NaN to 0 and saturates.
    table[((x * 256.0) as usize).min(255)]
}

/// Depth as a picture: inverse depth between its 2nd and 98th percentile over this image, near is red, far is violet; pixels
/// without a depth are black.
pub(super) fn colour_depth(depth: &[f32]) -> Vec<u8> {
    let mut sorted: Vec<f32> = depth.iter().filter_map(|&d| inverse(d)).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    colour_inverse(depth, [percentile(&sorted, 2.0).unwrap_or(0.0), percentile(&sorted, 98.0).unwrap_or(1.0)])
}

/// One over a depth, if it is one.
fn inverse(depth: f32) -> Option<f32> {
    (depth.is_finite() && depth > 0.0).then(|| 1.0 / depth).filter(|v| v.is_finite())
}

/// Depth as a picture: inverse depth between these two, near is red, far is violet; pixels without a depth are black.
pub(super) fn colour_inverse(depth: &[f32], [low, high]: [f32; 2]) -> Vec<u8> {
    // A flat depth map has no range: it gets one colour.
    let range = if high > low { high - low } else { f32::INFINITY };
    depth
        .iter()
        .flat_map(|&d| match inverse(d) {
            Some(v) => spectral(1.0 - ((v - low) / range).clamp(0.0, 1.0)),
            None => [0; 3],
        })
        .collect()
}

/// HSV (each 0..1) to 8-bit sRGB.
pub(super) fn hsv(hue: f64, saturation: f64, value: f64) -> [u8; 3] {
    let sector = |n: f64| {
        let k = (n + hue * 6.0) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [5.0, 3.0, 1.0].map(|n| (sector(n) * 255.0).round() as u8)
}

/// An 8-bit sRGB value as 16-bit linear light, which is what glTF's vertex colours hold.
pub(super) fn linear16(value: u8) -> u16 {
    static TABLE: OnceLock<[u16; 256]> = OnceLock::new();
    TABLE.get_or_init(|| {
        std::array::from_fn(|i| {
            let v = i as f64 / 255.0;
            let linear = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
            (linear * 65535.0).round() as u16
        })
    })[usize::from(value)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_map() {
        assert_eq!(spectral(0.0), [158, 1, 66]);
        assert_eq!(spectral(1.0), [94, 79, 162]);
        assert_eq!(spectral(f32::NAN), [158, 1, 66]);
    }

    #[test]
    fn near_is_red_and_holes_are_black() {
        let depth: Vec<f32> = (1..=100).map(|d| d as f32).chain([0.0, f32::NAN]).collect();
        let out = colour_depth(&depth);
        assert_eq!(out[..3], [158, 1, 66]);
        assert_eq!(out[99 * 3..100 * 3], [94, 79, 162]);
        assert_eq!(out[300..], [0; 6]);
        assert_eq!(colour_depth(&[2.0; 4])[..3], spectral(1.0));
    }

    #[test]
    fn hues() {
        assert_eq!(hsv(0.0, 1.0, 1.0), [255, 0, 0]);
        assert_eq!(hsv(1.0 / 3.0, 1.0, 1.0), [0, 255, 0]);
        assert_eq!(hsv(2.0 / 3.0, 0.5, 1.0), [128, 128, 255]);
    }
}
