//! The pixels of a sequence that are scored: those whose true depth is known and within a protocol's range.

use serde::Serialize;

use crate::EvalError;

/// What a data set's protocol says of range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Range {
    /// True depth from which on pixels are left out, metres.
    pub max_depth: Option<f64>,
    /// Aligned predictions are at most this, metres.
    pub clip: Option<f64>,
}

impl Range {
    /// KITTI: everything.
    pub const KITTI: Self = Self { max_depth: None, clip: None };
    /// Sintel: up to 70 m, predictions too.
    pub const SINTEL: Self = Self { max_depth: Some(70.0), clip: Some(70.0) };
    /// Bonn: up to 70 m.
    pub const BONN: Self = Self { max_depth: Some(70.0), clip: None };
}

/// Pixels of a sequence with known depth, frame after frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pixels {
    pub(super) predicted: Vec<f32>,
    pub(super) truth: Vec<f32>,
    /// Where each frame's pixels end.
    pub(super) ends: Vec<usize>,
    /// Known pixels whose prediction is NaN or infinite.
    not_finite: usize,
}

impl Pixels {
    /// Adds a frame: a prediction and its truth of the same size, row-major; truth that is 0, negative or NaN is unknown.
    ///
    /// # Errors
    /// [`EvalError::Counts`] for different sizes.
    pub fn add(&mut self, predicted: &[f32], truth: &[f32], range: Range) -> Result<(), EvalError> {
        EvalError::expect("pixels of a frame", predicted.len(), truth.len())?;
        for (&p, &g) in predicted.iter().zip(truth) {
            let known = g > 0.0 && g.is_finite() && range.max_depth.is_none_or(|most| f64::from(g) < most);
            if known && p.is_finite() {
                self.predicted.push(p);
                self.truth.push(g);
            }
            self.not_finite += usize::from(known && !p.is_finite());
        }
        self.ends.push(self.truth.len());
        Ok(())
    }

    /// The pixels of several lists, in their order.
    #[must_use]
    pub fn joined<'a>(lists: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        for list in lists {
            let before = all.truth.len();
            all.predicted.extend_from_slice(&list.predicted);
            all.truth.extend_from_slice(&list.truth);
            all.ends.extend(list.ends.iter().map(|end| before + end));
            all.not_finite += list.not_finite;
        }
        all
    }

    /// Pixels that are scored.
    #[must_use]
    pub fn len(&self) -> usize {
        self.truth.len()
    }

    /// Whether nothing is scored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.truth.is_empty()
    }

    /// Known pixels without a finite prediction: they cannot be aligned, and have to be said beside the result.
    #[must_use]
    pub fn not_finite(&self) -> usize {
        self.not_finite
    }

    pub(super) fn pairs(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        self.predicted.iter().zip(&self.truth).map(|(&p, &g)| (f64::from(p), f64::from(g)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_that_are_not_finite_are_counted() {
        let mut pixels = Pixels::default();
        pixels.add(&[f32::NAN, 5.0, f32::INFINITY], &[1.0, 5.0, -1.0], Range::KITTI).unwrap();
        assert_eq!((pixels.len(), pixels.not_finite()), (1, 1));
        assert!(Pixels::default().add(&[1.0], &[1.0, 2.0], Range::KITTI).is_err());
    }
}
