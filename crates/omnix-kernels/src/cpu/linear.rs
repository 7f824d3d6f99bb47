//! Oracle of `linear`.

use crate::Activation;

/// `y[m, n] = residual + gamma · act(x W + bias)` with `w(k, n)` the weight, row by row in f64.
#[must_use]
pub fn linear(
    (m, n, k): (usize, usize, usize),
    x: &[f32],
    w: &dyn Fn(usize, usize) -> f32,
    act: Activation,
    bias: Option<&[f32]>,
    gamma: Option<&[f32]>,
    residual: Option<&[f32]>,
) -> Vec<f32> {
    let mut y = vec![0.0; m * n];
    for row in 0..m {
        for column in 0..n {
            let mut sum = 0.0f64;
            for i in 0..k {
                sum += f64::from(x[row * k + i]) * f64::from(w(i, column));
            }
            sum = act.apply(sum + bias.map_or(0.0, |b| f64::from(b[column])));
            sum *= gamma.map_or(1.0, |g| f64::from(g[column]));
            sum += residual.map_or(0.0, |r| f64::from(r[row * n + column]));
            y[row * n + column] = sum as f32;
        }
    }
    y
}
