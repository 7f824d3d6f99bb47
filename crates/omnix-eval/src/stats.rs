//! Statistics of a list of numbers, as numpy has them.

use serde::Serialize;

/// What is said of a list of errors. `std` is the population's (divided by n).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Statistics {
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median; of an even count the mean of the two middle values.
    pub median: f64,
    /// Standard deviation.
    pub std: f64,
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
    /// Sum of squares.
    pub sse: f64,
}

impl Statistics {
    /// The statistics of `values`; none of an empty list.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let sse: f64 = values.iter().map(|v| v * v).sum();
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        Some(Self {
            rmse: (sse / n).sqrt(),
            mean,
            median: median(&mut values.to_vec())?,
            std: variance.sqrt(),
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            sse,
        })
    }
}

/// The median; of an even count the mean of the two middle values, as numpy's. Reorders the list; none of an empty one.
#[must_use]
pub fn median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    if n == 0 {
        return None;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return Some(upper);
    }
    let lower = below.iter().copied().max_by(f64::total_cmp)?;
    Some((lower + upper) / 2.0)
}

/// The median; of an even count the lower of the two middle values, as torch's. Reorders the list; none of an empty one.
#[must_use]
pub fn lower_median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = (values.len() - 1) / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The mean of those values that are numbers, and how many they are; NaN of none.
pub(crate) fn mean_of_numbers(values: impl IntoIterator<Item = f64>) -> (f64, usize) {
    let (mut sum, mut count) = (0.0, 0);
    for value in values.into_iter().filter(|v| !v.is_nan()) {
        sum += value;
        count += 1;
    }
    (if count == 0 { f64::NAN } else { sum / count as f64 }, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_counts() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(lower_median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut []), None);
        assert_eq!(lower_median(&mut []), None);
        assert_eq!(Statistics::of(&[]), None);
    }

    #[test]
    fn statistics_by_hand() {
        let found = Statistics::of(&[3.0, 1.0]).unwrap();
        let want = Statistics { rmse: 5f64.sqrt(), mean: 2.0, median: 2.0, std: 1.0, min: 1.0, max: 3.0, sse: 10.0 };
        assert_eq!(found, want);
    }

    #[test]
    fn the_mean_leaves_nan_out_and_says_so() {
        assert_eq!(mean_of_numbers([1.0, f64::NAN, 3.0]), (2.0, 2));
        assert!(mean_of_numbers([f64::NAN]).0.is_nan());
    }
}
