//! How a picture came to the network's size: resized as a whole, then a rectangle of it cut out.

/// Sizes in pixels. Intrinsics of the source picture follow from those of the prepared one: with `s = resized / source size`,
/// `fx / s_x`, `fy / s_y`, `(cx + left) / s_x`, `(cy + top) / s_y`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Framing {
    /// Width and height of the whole picture after resizing.
    pub resized: (u32, u32),
    /// Left, top, width and height of what is kept of that.
    pub crop: [u32; 4],
}

impl Framing {
    /// The whole picture, resized.
    #[must_use]
    pub fn whole(resized: (u32, u32)) -> Self {
        Self { resized, crop: [0, 0, resized.0, resized.1] }
    }

    /// Cuts the centre out of what is kept so far, the larger half of an odd rest staying right and below.
    #[must_use]
    pub(super) fn centre(self, (width, height): (u32, u32)) -> Self {
        let [left, top, w, h] = self.crop;
        let rest = |have: u32, want: u32| have.saturating_sub(want) / 2;
        Self { crop: [left + rest(w, width), top + rest(h, height), width, height], ..self }
    }

    /// Share of the picture that is kept, by area.
    #[must_use]
    pub fn kept(self) -> f64 {
        let area = |w: u32, h: u32| f64::from(w) * f64::from(h);
        area(self.crop[2], self.crop[3]) / area(self.resized.0, self.resized.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_add_up() {
        let framing = Framing::whole((101, 60)).centre((90, 56)).centre((70, 56));
        assert_eq!(framing, Framing { resized: (101, 60), crop: [15, 2, 70, 56] });
        assert!((framing.kept() - 70.0 * 56.0 / 6060.0).abs() < 1e-12);
    }
}
