//! The numbers of aligned depth, of a sequence and of a data set.

use serde::Serialize;

use super::pixels::{Pixels, Range};
use super::scale::{Alignment, Fit};

/// The least depth that logarithms and ratios see.
const LEAST: f64 = 1e-5;

/// The numbers of a sequence or of a mean. Without a valid pixel all are 0, with weight 0.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct DepthMetrics {
    /// Mean of |p - g| / g.
    pub abs_rel: f64,
    /// Mean of (p - g)^2 / g, metres.
    pub sq_rel: f64,
    /// Root of the mean square of p - g, metres.
    pub rmse: f64,
    /// Root of the mean square of log p - log g.
    pub log_rmse: f64,
    /// Shares of pixels within factors of 1.25, 1.25^2, 1.25^3.
    pub delta: [f64; 3],
    /// Pixels scored: the weight in a mean.
    pub valid_pixels: u64,
}

/// A sequence's result.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthScore {
    /// Scale and shift that were applied.
    pub fit: Fit,
    /// The numbers.
    pub metrics: DepthMetrics,
    /// Abs Rel of each frame; NaN of a frame without a valid pixel.
    pub by_frame: Vec<f64>,
}

/// Aligns a sequence and scores it.
#[must_use]
pub fn score(pixels: &Pixels, alignment: Alignment, range: Range) -> DepthScore {
    let fit = alignment.fit(pixels);
    let most = range.clip.unwrap_or(f64::INFINITY);
    let aligned = |p: f64| (fit.scale * p + fit.shift).min(most);
    let (mut sums, mut by_frame, mut done) = (Sums::default(), Vec::with_capacity(pixels.ends.len()), 0);
    let mut pairs = pixels.pairs();
    for &end in &pixels.ends {
        let before = sums.abs_rel;
        for (p, g) in pairs.by_ref().take(end - done) {
            sums.add(aligned(p), g);
        }
        by_frame.push((sums.abs_rel - before) / (end - done) as f64);
        done = end;
    }
    DepthScore { fit, metrics: sums.metrics(), by_frame }
}

/// The mean over sequences, weighted by their valid pixels.
#[must_use]
pub fn mean(sequences: &[DepthMetrics]) -> DepthMetrics {
    let pixels: u64 = sequences.iter().map(|s| s.valid_pixels).sum();
    if pixels == 0 {
        return DepthMetrics::default();
    }
    let of = |value: &dyn Fn(&DepthMetrics) -> f64| {
        sequences.iter().map(|s| value(s) * s.valid_pixels as f64).sum::<f64>() / pixels as f64
    };
    DepthMetrics {
        abs_rel: of(&|s| s.abs_rel),
        sq_rel: of(&|s| s.sq_rel),
        rmse: of(&|s| s.rmse),
        log_rmse: of(&|s| s.log_rmse),
        delta: std::array::from_fn(|k| of(&|s| s.delta[k])),
        valid_pixels: pixels,
    }
}

#[derive(Default)]
struct Sums {
    abs_rel: f64,
    sq_rel: f64,
    square: f64,
    log_square: f64,
    within: [u64; 3],
    pixels: u64,
}

impl Sums {
    fn add(&mut self, p: f64, g: f64) {
        let error = p - g;
        self.abs_rel += error.abs() / g;
        self.sq_rel += error * error / g;
        self.square += error * error;
        let p = p.max(LEAST);
        let log = p.ln() - g.ln();
        self.log_square += log * log;
        let ratio = (p / g).max(g / p);
        for (count, limit) in self.within.iter_mut().zip([1.25, 1.25 * 1.25, 1.25 * 1.25 * 1.25]) {
            *count += u64::from(ratio < limit);
        }
        self.pixels += 1;
    }

    fn metrics(&self) -> DepthMetrics {
        if self.pixels == 0 {
            return DepthMetrics::default();
        }
        let n = self.pixels as f64;
        DepthMetrics {
            abs_rel: self.abs_rel / n,
            sq_rel: self.sq_rel / n,
            rmse: (self.square / n).sqrt(),
            log_rmse: (self.log_square / n).sqrt(),
            delta: self.within.map(|count| count as f64 / n),
            valid_pixels: self.pixels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(predicted: &[f32], truth: &[f32], range: Range) -> Pixels {
        let mut pixels = Pixels::default();
        pixels.add(predicted, truth, range).unwrap();
        pixels
    }

    #[test]
    fn by_hand() {
        let two = pixels(&[1.0, 4.0, 9.0], &[2.0, 4.0, 0.0], Range::KITTI);
        let found = score(&two, Alignment::Metric, Range::KITTI);
        assert_eq!((found.metrics.abs_rel, found.metrics.sq_rel), (0.25, 0.25));
        assert_eq!((found.metrics.delta, found.metrics.valid_pixels), ([0.5, 0.5, 0.5], 2));
        assert_eq!(found.by_frame, [0.25]);
    }

    #[test]
    fn far_depth_is_left_out_and_predictions_are_clipped() {
        let two = pixels(&[1000.0, 5.0], &[60.0, 71.0], Range::SINTEL);
        let found = score(&two, Alignment::Metric, Range::SINTEL);
        assert_eq!(found.metrics.valid_pixels, 1);
        assert!((found.metrics.abs_rel - 10.0 / 60.0).abs() < 1e-12);
    }

    #[test]
    fn means_weigh_pixels() {
        let one = DepthMetrics { abs_rel: 1.0, valid_pixels: 1, ..DepthMetrics::default() };
        let many = DepthMetrics { abs_rel: 0.0, valid_pixels: 3, ..DepthMetrics::default() };
        assert_eq!(mean(&[one, many]).abs_rel, 0.25);
        assert_eq!(mean(&[]), DepthMetrics::default());
    }
}
