//! The scale, or scale and shift, that brings predicted depth onto the truth: one for all pixels of a sequence.

use serde::Serialize;

use super::pixels::Pixels;
use crate::stats::lower_median;

/// Turns of the reweighted least squares, what a residual is at least, and what the scale is at least at the end.
const TURNS: usize = 10;
const LEAST_RESIDUAL: f64 = 1e-8;
const LEAST_SCALE: f64 = 1e-3;

/// How predicted depth is brought onto the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// Not at all.
    Metric,
    /// `s = med(g)/med(p)`, the lower median of an even count.
    Median,
    /// The scale with the least sum of |s p - g|: 10 turns of reweighted least squares from mean(g)/mean(p).
    Scale,
    /// Scale and shift by Adam on the sum of |s p + t - g|, from the medians' ratio and 0: at most 1000 steps of 1e-4, so it is not the
    /// optimum, and the shift stays within about 0.1. What papers print as "scale & shift".
    ScaleShiftAdam,
    /// Scale and shift by least squares.
    ScaleShiftLeastSquares,
}

/// `p' = scale p + shift`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fit {
    /// Factor.
    pub scale: f64,
    /// Added afterwards, in the truth's unit.
    pub shift: f64,
}

impl Alignment {
    /// All of them, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::Scale, Self::Median, Self::ScaleShiftAdam, Self::ScaleShiftLeastSquares, Self::Metric];

    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Metric => "metric",
            Self::Median => "median",
            Self::Scale => "scale",
            Self::ScaleShiftAdam => "scale_and_shift_adam",
            Self::ScaleShiftLeastSquares => "scale_and_shift_least_squares",
        }
    }

    /// Fits the pixels; scale 1 and shift 0 where there are none.
    #[must_use]
    pub fn fit(self, pixels: &Pixels) -> Fit {
        if pixels.is_empty() {
            return Fit { scale: 1.0, shift: 0.0 };
        }
        let of_scale = |scale| Fit { scale, shift: 0.0 };
        match self {
            Self::Metric => of_scale(1.0),
            Self::Median => of_scale(median_ratio(pixels)),
            Self::Scale => of_scale(least_absolute(pixels)),
            Self::ScaleShiftAdam => adam(pixels),
            Self::ScaleShiftLeastSquares => least_squares(pixels),
        }
    }
}

fn median_ratio(pixels: &Pixels) -> f64 {
    let median = |values: &[f32]| {
        let mut values: Vec<f64> = values.iter().copied().map(f64::from).collect();
        lower_median(&mut values).unwrap_or(f64::NAN)
    };
    median(&pixels.truth) / median(&pixels.predicted)
}

fn least_absolute(pixels: &Pixels) -> f64 {
    let sum = |values: &[f32]| values.iter().copied().map(f64::from).sum::<f64>();
    let mut scale = sum(&pixels.truth) / sum(&pixels.predicted);
    for _ in 0..TURNS {
        let (mut pg, mut pp) = (0.0, 0.0);
        for (p, g) in pixels.pairs() {
            let weight = 1.0 / ((scale * p - g).abs() + LEAST_RESIDUAL);
            pg += weight * p * g;
            pp += weight * p * p;
        }
        scale = pg / pp;
    }
    scale.max(LEAST_SCALE)
}

fn least_squares(pixels: &Pixels) -> Fit {
    let n = pixels.len() as f64;
    let (sum_p, sum_g) = pixels.pairs().fold((0.0, 0.0), |(a, b), (p, g)| (a + p, b + g));
    let (mean_p, mean_g) = (sum_p / n, sum_g / n);
    let (mut pp, mut pg) = (0.0, 0.0);
    for (p, g) in pixels.pairs() {
        pp += (p - mean_p) * (p - mean_p);
        pg += (p - mean_p) * (g - mean_g);
    }
    if pp > 0.0 {
        let scale = pg / pp;
        Fit { scale, shift: mean_g - scale * mean_p }
    } else {
        // A constant prediction: of all solutions the one of least norm, as numpy's.
        let divisor = mean_p * mean_p + 1.0;
        Fit { scale: mean_g * mean_p / divisor, shift: mean_g / divisor }
    }
}

fn adam(pixels: &Pixels) -> Fit {
    const STEPS: i32 = 1000;
    const RATE: f64 = 1e-4;
    const BETAS: [f64; 2] = [0.9, 0.999];
    const EPSILON: f64 = 1e-8;
    const TOLERANCE: f64 = 1e-6;
    let mut at = [median_ratio(pixels), 0.0];
    let (mut first, mut second, mut before) = ([0.0; 2], [0.0; 2], f64::INFINITY);
    for step in 1..=STEPS {
        let (mut loss, mut gradient) = (0.0, [0.0; 2]);
        for (p, g) in pixels.pairs() {
            let error = at[0] * p + at[1] - g;
            loss += error.abs();
            // The derivative of |0| is 0.
            let sign = if error == 0.0 { 0.0 } else { error.signum() };
            gradient[0] += sign * p;
            gradient[1] += sign;
        }
        for k in 0..2 {
            first[k] = BETAS[0] * first[k] + (1.0 - BETAS[0]) * gradient[k];
            second[k] = BETAS[1] * second[k] + (1.0 - BETAS[1]) * gradient[k] * gradient[k];
            let mean = first[k] / (1.0 - BETAS[0].powi(step));
            let spread = (second[k] / (1.0 - BETAS[1].powi(step))).sqrt();
            at[k] -= RATE * mean / (spread + EPSILON);
        }
        if (before - loss).abs() < TOLERANCE {
            break;
        }
        before = loss;
    }
    Fit { scale: at[0], shift: at[1] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::pixels::Range;

    fn line() -> Pixels {
        let predicted: Vec<f32> = (1..40).map(|k| k as f32 * 0.1).collect();
        let truth: Vec<f32> = predicted.iter().map(|p| 3.0 * p + 0.5).collect();
        let mut pixels = Pixels::default();
        pixels.add(&predicted, &truth, Range::KITTI).unwrap();
        pixels
    }

    #[test]
    fn least_squares_finds_a_line_and_adam_stays_near_its_start() {
        let fit = Alignment::ScaleShiftLeastSquares.fit(&line());
        assert!((fit.scale - 3.0).abs() < 1e-5 && (fit.shift - 0.5).abs() < 1e-5, "{fit:?}");
        let near = Alignment::ScaleShiftAdam.fit(&line());
        assert!(near.shift > 0.01 && near.shift < 0.2, "{near:?}");
    }

    #[test]
    fn an_outlier_does_not_move_the_absolute_scale() {
        let mut pixels = Pixels::default();
        let predicted: Vec<f32> = (1..42).map(|k| k as f32).collect();
        let mut truth: Vec<f32> = predicted.iter().map(|p| 2.0 * p).collect();
        truth[40] = 500.0;
        pixels.add(&predicted, &truth, Range::KITTI).unwrap();
        let (absolute, least) = (Alignment::Scale.fit(&pixels), Alignment::ScaleShiftLeastSquares.fit(&pixels));
        assert!((absolute.scale - 2.0).abs() < 1e-3 && least.scale > 2.5, "{absolute:?} {least:?}");
    }

    #[test]
    fn constants_and_nothing_have_a_finite_fit() {
        let mut flat = Pixels::default();
        flat.add(&[2.0; 4], &[4.0; 4], Range::KITTI).unwrap();
        let fit = Alignment::ScaleShiftLeastSquares.fit(&flat);
        assert!((2.0 * fit.scale + fit.shift - 4.0).abs() < 1e-12);
        for alignment in Alignment::ALL {
            assert_eq!(alignment.fit(&Pixels::default()), Fit { scale: 1.0, shift: 0.0 });
        }
    }
}
