//! Oracle of `rank`.

use crate::rank::{Rank, Which};

/// The number of the wanted rank of each row of `x`.
#[must_use]
pub fn rank(spec: &Rank, x: &[f32]) -> Vec<f32> {
    let of_row = |row: &[f32]| {
        let mut numbers: Vec<f32> = row.iter().copied().filter(|v| !v.is_nan()).collect();
        numbers.sort_by(f32::total_cmp);
        let at = match spec.which {
            Which::At(rank) => rank as usize,
            Which::Quantile { .. } if numbers.is_empty() => 0,
            Which::Quantile { numerator, denominator } => {
                // Exact: the products stay far below 2^53.
                let place = (numbers.len() - 1) as f64 * f64::from(numerator);
                (place / f64::from(denominator)).round_ties_even() as usize
            }
        };
        // -0 comes out as 0.
        numbers.get(at).map_or(f32::NAN, |v| v + 0.0)
    };
    x.chunks_exact(spec.n as usize).map(of_row).collect()
}
