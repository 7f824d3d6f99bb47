//! Depth against its truth, with whatever scale or line makes the mean relative error least.
//!
//! The least Σ |s p − g| / g over s is the median of g / p with weights p / g. A line over rows is fitted by least squares that are
//! reweighted until they are the least sum of absolute relative errors.

/// Turns of the reweighting, and what a relative error is at least in it.
const TURNS: usize = 50;
const LEAST: f64 = 1e-6;

/// The best scale of a prediction, and its mean relative error and share within 1.25. Pixels count where the truth is known and the
/// prediction above 0.
pub(super) fn best_scale(predicted: &[f32], truth: &[f32]) -> (f64, (f64, f64)) {
    let pairs = known(predicted.iter().copied().map(f64::from), truth);
    let mut ratios: Vec<(f64, f64)> = pairs.iter().map(|(p, g)| (g / p, p / g)).collect();
    let scale = weighted_median(&mut ratios);
    (scale, errors(pairs.iter().map(|(p, g)| (scale * p, *g))))
}

/// The errors of the best line over rows.
pub(super) fn best_rows(rows: &[f64], truth: &[f32]) -> (f64, f64) {
    let pairs: Vec<(f64, f64)> =
        rows.iter().zip(truth).filter(|(_, g)| g.is_finite()).map(|(r, g)| (*r, f64::from(*g))).collect();
    let (mut a, mut b) = (pairs.iter().map(|(_, g)| g).sum::<f64>() / pairs.len() as f64, 0.0);
    let error = |a: f64, b: f64| errors(pairs.iter().map(|(r, g)| (a + b * r, *g)));
    let mut best = error(a, b);
    for _ in 0..TURNS {
        // Σ w (a + b r − g)², w = 1 / (g² |relative error|).
        let (mut w0, mut w1, mut w2, mut g0, mut g1) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &(r, g) in &pairs {
            let w = 1.0 / (g * g * ((a + b * r - g).abs() / g).max(LEAST));
            w0 += w;
            w1 += w * r;
            w2 += w * r * r;
            g0 += w * g;
            g1 += w * r * g;
        }
        let determinant = w0 * w2 - w1 * w1;
        if determinant.abs() <= f64::EPSILON * w0 * w2 {
            break;
        }
        (a, b) = ((w2 * g0 - w1 * g1) / determinant, (w0 * g1 - w1 * g0) / determinant);
        let found = error(a, b);
        if found.0 < best.0 {
            best = found;
        }
    }
    best
}

/// Pairs of a prediction above 0 and a known truth.
fn known(predicted: impl Iterator<Item = f64>, truth: &[f32]) -> Vec<(f64, f64)> {
    predicted
        .zip(truth)
        .filter(|(p, g)| *p > 0.0 && p.is_finite() && g.is_finite())
        .map(|(p, g)| (p, f64::from(*g)))
        .collect()
}

/// The value at which half of the weight is reached; NaN of nothing. Pairs are (value, weight).
fn weighted_median(pairs: &mut [(f64, f64)]) -> f64 {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = pairs.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for (value, weight) in pairs.iter() {
        sum += weight;
        if sum >= half {
            return *value;
        }
    }
    f64::NAN
}

/// Mean relative error, and share within 1.25; NaN of nothing.
fn errors(pairs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut sum, mut within, mut count) = (0.0, 0usize, 0usize);
    for (p, g) in pairs {
        sum += (p - g).abs() / g;
        within += usize::from(p > 0.0 && (p / g).max(g / p) < 1.25);
        count += 1;
    }
    (sum / count as f64, within as f64 / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_the_best_one() {
        let truth: Vec<f32> = (0..101).map(|i| 1.0 + (i * 37 % 101) as f32 / 50.0).collect();
        let predicted: Vec<f32> =
            truth.iter().enumerate().map(|(i, g)| 0.4 * g * if i % 7 == 0 { 1.5 } else { 1.0 }).collect();
        let (scale, (abs_rel, delta)) = best_scale(&predicted, &truth);
        assert!((scale - 2.5).abs() < 1e-6);
        assert!((abs_rel - 0.5 * 15.0 / 101.0).abs() < 1e-6 && (delta - 86.0 / 101.0).abs() < 1e-12);
        let error = |s: f64| errors(predicted.iter().zip(&truth).map(|(p, g)| (s * f64::from(*p), f64::from(*g)))).0;
        assert!([0.9, 0.99, 1.01, 1.1].iter().all(|f| error(scale * f) > abs_rel));
    }

    #[test]
    fn unknown_pixels_and_nothing_at_all() {
        let (scale, (abs_rel, _)) = best_scale(&[1.0, 5.0, -1.0], &[2.0, f32::NAN, 9.0]);
        assert_eq!((scale, abs_rel), (2.0, 0.0));
        let (scale, (abs_rel, delta)) = best_scale(&[1.0], &[f32::NAN]);
        assert!(scale.is_nan() && abs_rel.is_nan() && delta.is_nan());
    }

    #[test]
    fn a_line_over_rows_is_found_and_is_no_worse_than_a_constant() {
        let rows: Vec<f64> = (0..400).map(|i| f64::from(i / 20)).collect();
        let line: Vec<f32> = rows.iter().map(|r| (5.0 - 0.1 * r) as f32).collect();
        assert!(best_rows(&rows, &line).0 < 1e-6);
        let rough: Vec<f32> =
            line.iter().enumerate().map(|(i, g)| g * (1.0 + 0.2 * ((i * 7 % 13) as f32 / 13.0 - 0.5))).collect();
        assert!(best_rows(&rows, &rough).0 < best_scale(&[1.0; 400], &rough).1.0);
    }
}
