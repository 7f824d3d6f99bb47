//! Oracle of `reduce`.

use crate::reduce::ReduceOp;

/// `op` over the middle axis of `x[outer, n, inner]` in f64.
#[must_use]
pub fn reduce((outer, n, inner): (usize, usize, usize), op: ReduceOp, x: &[f32]) -> Vec<f32> {
    let mut y = Vec::with_capacity(outer * inner);
    for o in 0..outer {
        for i in 0..inner {
            let values: Vec<f64> = (0..n).map(|j| f64::from(x[(o * n + j) * inner + i])).collect();
            let mean = values.iter().sum::<f64>() / n as f64;
            let result = match op {
                ReduceOp::Sum => values.iter().sum(),
                ReduceOp::Mean => mean,
                ReduceOp::Max => values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                ReduceOp::Min => values.iter().copied().fold(f64::INFINITY, f64::min),
                ReduceOp::Std if n == 1 => 0.0,
                ReduceOp::Std => (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1) as f64).sqrt(),
            };
            y.push(result as f32);
        }
    }
    y
}
