//! Oracle of `swiglu`.

use crate::Activation;

/// `y[m, j] = silu(x[m, j]) · x[m, h + j]` with x `[m, 2h]`.
#[must_use]
pub fn swiglu((m, h): (usize, usize), x: &[f32]) -> Vec<f32> {
    let mut y = Vec::with_capacity(m * h);
    for row in 0..m {
        for j in 0..h {
            let (gate, value) = (x[row * 2 * h + j], x[row * 2 * h + h + j]);
            y.push((Activation::Silu.apply(gate.into()) * f64::from(value)) as f32);
        }
    }
    y
}
