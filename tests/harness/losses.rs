//! The losses of training as plain f64 functions, written from `eval.md` section 8: what a trainer's losses are checked against.
//!
//! Arrays are row-major; `valid` says of each pixel (or sample) whether it counts. The recorded numbers of the published loss code are in
//! `golden/eval/losses`, which `tests/goldens` compares these with.

/// Norm over the channels of a pixel's error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// Sum of absolute values.
    L1,
    /// Euclidean.
    L2,
}

/// A regression loss with confidence: sums over valid pixels, and the derivatives of the paper's mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Robust {
    /// `sum(l1 C |x - x*| - l2 log C)`.
    pub weighted_minus_log_sum: f64,
    /// `sum |x - x*|`.
    pub plain_sum: f64,
    /// Valid pixels.
    pub valid: usize,
    /// All pixels.
    pub pixels: usize,
    /// Derivative of [`Robust::mean_over_valid`] by each predicted channel.
    pub by_prediction: Vec<f64>,
    /// And by each confidence.
    pub by_confidence: Vec<f64>,
}

impl Robust {
    /// `mean over valid of (1 + l1 C) |x - x*| - l2 log C`, the paper's formula.
    #[must_use]
    pub fn mean_over_valid(&self) -> f64 {
        (self.weighted_minus_log_sum + self.plain_sum) / self.valid as f64
    }

    /// The same sum over all pixels' count.
    #[must_use]
    pub fn mean_over_all(&self) -> f64 {
        (self.weighted_minus_log_sum + self.plain_sum) / self.pixels as f64
    }
}

/// The regression loss of predictions `[pixels][channels]`; confidence and `valid` have one entry for each pixel. At an error of 0 the
/// derivative is 0.
#[must_use]
pub fn robust(
    predicted: &[f64],
    truth: &[f64],
    confidence: &[f64],
    valid: &[bool],
    norm: Norm,
    [l1, l2]: [f64; 2],
) -> Robust {
    let (pixels, channels) = (valid.len(), predicted.len() / valid.len());
    let count = valid.iter().filter(|v| **v).count();
    let (mut weighted, mut plain) = (0.0, 0.0);
    let (mut by_prediction, mut by_confidence) = (vec![0.0; predicted.len()], vec![0.0; pixels]);
    for pixel in (0..pixels).filter(|&k| valid[k]) {
        let own = pixel * channels..(pixel + 1) * channels;
        let error: Vec<f64> = predicted[own.clone()].iter().zip(&truth[own.clone()]).map(|(p, g)| p - g).collect();
        let size = match norm {
            Norm::L1 => error.iter().map(|e| e.abs()).sum(),
            Norm::L2 => error.iter().map(|e| e * e).sum::<f64>().sqrt(),
        };
        let c = confidence[pixel];
        weighted += l1 * c * size - l2 * c.ln();
        plain += size;
        for (derivative, &e) in by_prediction[own].iter_mut().zip(&error) {
            let slope = match norm {
                _ if e == 0.0 => 0.0,
                Norm::L1 => e.signum(),
                Norm::L2 => e / size,
            };
            *derivative = (1.0 + l1 * c) * slope / count as f64;
        }
        by_confidence[pixel] = (l1 * size - l2 / c) / count as f64;
    }
    Robust { weighted_minus_log_sum: weighted, plain_sum: plain, valid: count, pixels, by_prediction, by_confidence }
}

/// The gradient loss of maps `[images][height][width]`, of which every `step`-th pixel is used: the sum of `|dx (x - x*)|` and
/// `|dy (x - x*)|` over pairs of which both are valid, each at most 100, divided by the number of valid pixels.
#[must_use]
pub fn gradient(predicted: &[f64], truth: &[f64], valid: &[bool], [width, height]: [usize; 2], step: usize) -> f64 {
    const MOST: f64 = 100.0;
    let error = |k: usize| predicted[k] - truth[k];
    let (mut sum, mut count) = (0.0, 0usize);
    for image in 0..valid.len() / (width * height) {
        for y in (0..height).step_by(step) {
            for x in (0..width).step_by(step) {
                let at = (image * height + y) * width + x;
                count += usize::from(valid[at]);
                let right = (x + step < width).then_some(at + step);
                let below = (y + step < height).then_some(at + step * width);
                for other in right.into_iter().chain(below).filter(|&other| valid[at] && valid[other]) {
                    sum += (error(other) - error(at)).abs().min(MOST);
                }
            }
        }
    }
    sum / count as f64
}

/// The mean of [`gradient`] over every 1st, 2nd, 4th and 8th pixel.
#[must_use]
pub fn gradient_over_scales(predicted: &[f64], truth: &[f64], valid: &[bool], size: [usize; 2]) -> f64 {
    [1, 2, 4, 8].iter().map(|&step| gradient(predicted, truth, valid, size, step)).sum::<f64>() / 4.0
}

/// Mean absolute error.
#[must_use]
pub fn l1(predicted: &[f64], truth: &[f64]) -> f64 {
    predicted.iter().zip(truth).map(|(p, g)| (p - g).abs()).sum::<f64>() / predicted.len() as f64
}

/// Mean Huber loss: `e^2/2` up to `delta`, `delta (|e| - delta/2)` beyond.
#[must_use]
pub fn huber(predicted: &[f64], truth: &[f64], delta: f64) -> f64 {
    let one = |e: f64| if e <= delta { 0.5 * e * e } else { delta * (e - 0.5 * delta) };
    predicted.iter().zip(truth).map(|(p, g)| one((p - g).abs())).sum::<f64>() / predicted.len() as f64
}

/// Whether each pixel moves, of positions `[images][times][pixels]`: its largest step between consecutive times is above `threshold`. Steps
/// from or to an unknown position are skipped; none of a pixel without a step.
#[must_use]
pub fn moving_pixels(positions: &[[f64; 3]], times: usize, pixels: usize, threshold: f64) -> Vec<Option<bool>> {
    let image = |image: usize| {
        move |pixel: usize| {
            let at = |time: usize| positions[(image * times + time) * pixels + pixel];
            let steps = (1..times).map(|t| {
                let (from, to) = (at(t - 1), at(t));
                (0..3).map(|k| (to[k] - from[k]) * (to[k] - from[k])).sum::<f64>().sqrt()
            });
            steps.filter(|step| !step.is_nan()).max_by(f64::total_cmp).map(|largest| largest > threshold)
        }
    };
    (0..positions.len() / (times * pixels)).flat_map(|k| (0..pixels).map(image(k))).collect()
}

/// Whether a token moves: any of its pixels does; none where none of its pixels is known. Pixels `[images][height][width]`, tokens of
/// `patch` x `patch` pixels.
#[must_use]
pub fn moving_tokens(pixels: &[Option<bool>], [width, height]: [usize; 2], patch: usize) -> Vec<Option<bool>> {
    let mut tokens = Vec::new();
    for image in pixels.chunks_exact(width * height) {
        for row in 0..height / patch {
            for column in 0..width / patch {
                let own =
                    (0..patch * patch).map(|k| image[(row * patch + k / patch) * width + column * patch + k % patch]);
                tokens.push(own.flatten().reduce(|a, b| a || b));
            }
        }
    }
    tokens
}

/// Mean binary cross-entropy over targets that are known. Probabilities are kept `margin` away from 0 and 1; logarithms are at least -100.
#[must_use]
pub fn cross_entropy(probability: &[f64], target: &[Option<bool>], margin: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for (p, target) in probability.iter().zip(target) {
        if let Some(target) = target {
            let p = p.clamp(margin, 1.0 - margin);
            let logarithm = if *target { p.ln() } else { (1.0 - p).ln() };
            sum -= logarithm.max(-100.0);
            count += 1;
        }
    }
    sum / count as f64
}

/// The values below the quantile `q`, which is the value of the nearest rank.
#[must_use]
pub fn below_quantile(values: &[f64], q: f64) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return Vec::new();
    };
    let limit = sorted[(q * last as f64).round() as usize];
    values.iter().copied().filter(|v| *v < limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let (truth, valid) = ([0.5, -1.0, 0.25, 2.0], [true, false]);
        let (predicted, confidence) = ([1.0, 0.5, 0.0, 0.0], [1.5, 2.0]);
        for norm in [Norm::L1, Norm::L2] {
            let at = |p: &[f64], c: &[f64]| robust(p, &truth, c, &valid, norm, [1.0, 0.2]);
            let found = at(&predicted, &confidence);
            for k in 0..4 {
                let moved = |by: f64| {
                    let mut p = predicted;
                    p[k] += by;
                    at(&p, &confidence).mean_over_valid()
                };
                assert!((found.by_prediction[k] - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() < 1e-8);
            }
            for k in 0..2 {
                let moved = |by: f64| {
                    let mut c = confidence;
                    c[k] += by;
                    at(&predicted, &c).mean_over_valid()
                };
                assert!((found.by_confidence[k] - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn unknown_pixels_are_left_out() {
        let unknown = [f64::NAN; 3];
        let positions = [[0.0; 3], unknown, [0.0; 3], unknown, [0.5, 0.0, 0.0], unknown];
        let moving = moving_pixels(&positions, 3, 2, 0.1);
        assert_eq!(moving, [Some(true), None]);
        assert_eq!(moving_tokens(&moving, [2, 1], 1), [Some(true), None]);
        assert!((cross_entropy(&[0.5, 0.1], &moving, 0.0) - 2f64.ln()).abs() < 1e-12);
        assert!((cross_entropy(&[0.0], &[Some(true)], 0.0) - 100.0).abs() < 1e-12);
    }
}
