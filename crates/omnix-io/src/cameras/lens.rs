//! Lenses: focal length, principal point, and the distortion that is taken out of pictures.

use crate::Picture;

/// Coefficients of OpenCV's rational model: of radius squared, to the fourth and sixth, above and below the line, and tangential ones.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Distortion {
    /// k1 to k6.
    pub radial: [f64; 6],
    /// p1, p2.
    pub tangential: [f64; 2],
}

/// A lens, in pixels of the picture that it is for, counted from the corner of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Focal lengths across and down.
    pub focal: [f64; 2],
    /// Principal point; the middle where a file does not say it.
    pub centre: Option<[f64; 2]>,
    /// Distortion.
    pub distortion: Distortion,
}

impl Distortion {
    /// Whether lines stay straight.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Where a direction (x, y, 1) is seen, as (x', y') at distance 1.
    pub(super) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        let [p1, p2] = self.tangential;
        let r = x * x + y * y;
        let radial = (1.0 + r * (k1 + r * (k2 + r * k3))) / (1.0 + r * (k4 + r * (k5 + r * k6)));
        [x * radial + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x), y * radial + p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y]
    }
}

impl Lens {
    /// The same lens for the same picture at another size, its principal point said.
    #[must_use]
    pub fn resized(&self, from: [u32; 2], to: [u32; 2]) -> Self {
        let factor = [0, 1].map(|axis| f64::from(to[axis]) / f64::from(from[axis]));
        let centre = self.centre.unwrap_or(from.map(|side| f64::from(side) / 2.0));
        Self {
            focal: [0, 1].map(|axis| self.focal[axis] * factor[axis]),
            centre: Some([0, 1].map(|axis| centre[axis] * factor[axis])),
            distortion: self.distortion,
        }
    }

    /// The 3x3 matrix for a picture of this size.
    #[must_use]
    pub fn intrinsics(&self, size: [u32; 2]) -> [[f32; 3]; 3] {
        let [cx, cy] = self.centre.unwrap_or(size.map(|side| f64::from(side) / 2.0));
        let [fx, fy] = self.focal;
        [[fx as f32, 0.0, cx as f32], [0.0, fy as f32, cy as f32], [0.0, 0.0, 1.0]]
    }

    /// Where a place of the undistorted picture ([`Lens::undistort`]) is in the picture itself, in pixels from the corner of the first.
    #[must_use]
    pub fn seen_at(&self, [x, y]: [f64; 2], size: [u32; 2]) -> [f64; 2] {
        let [cx, cy] = self.centre.unwrap_or(size.map(|side| f64::from(side) / 2.0));
        let [fx, fy] = self.focal;
        let [x, y] = self.distortion.apply([(x - cx) / fx, (y - cy) / fy]);
        [x * fx + cx, y * fy + cy]
    }

    /// The picture as a lens without distortion of the same focal length and principal point would have taken it, by bilinear
    /// interpolation; black where this lens saw nothing.
    #[must_use]
    pub fn undistort(&self, picture: &Picture) -> Picture {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let size = [picture.width, picture.height];
        let mut data = Vec::with_capacity(picture.data.len());
        for row in 0..height {
            for column in 0..width {
                // Of pixel centres, which lie half a pixel from the corner.
                let [u, v] = self.seen_at([column as f64 + 0.5, row as f64 + 0.5], size);
                data.extend(sample(picture, u - 0.5, v - 0.5));
            }
        }
        Picture::new(picture.width, picture.height, data)
    }
}

/// The colour at a place between pixel centres; black half a pixel beyond them.
fn sample(picture: &Picture, u: f64, v: f64) -> [u8; 3] {
    let (width, height) = (f64::from(picture.width), f64::from(picture.height));
    if !(u >= -0.5 && v >= -0.5 && u <= width - 0.5 && v <= height - 0.5) {
        return [0; 3];
    }
    let (u, v) = (u.clamp(0.0, width - 1.0), v.clamp(0.0, height - 1.0));
    let (left, top) = (u.floor(), v.floor());
    let (a, b) = (u - left, v - top);
    let at = |column: f64, row: f64, channel: usize| {
        let index = row.min(height - 1.0) as usize * picture.width as usize + column.min(width - 1.0) as usize;
        f64::from(picture.data[3 * index + channel])
    };
    std::array::from_fn(|channel| {
        let above = (1.0 - a) * at(left, top, channel) + a * at(left + 1.0, top, channel);
        let below = (1.0 - a) * at(left, top + 1.0, channel) + a * at(left + 1.0, top + 1.0, channel);
        ((1.0 - b) * above + b * below).round() as u8
    })
}
