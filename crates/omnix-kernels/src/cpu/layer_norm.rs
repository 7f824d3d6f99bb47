//! Oracle of `layer_norm`.

use crate::Activation;

/// `y[m, c] = act((x − mean) / √(var + eps) · weight + bias)` row by row in f64; the divisor of var is c.
#[must_use]
pub fn layer_norm(
    (m, c): (usize, usize),
    x: &[f32],
    eps: f32,
    act: Activation,
    weight: Option<&[f32]>,
    bias: Option<&[f32]>,
) -> Vec<f32> {
    let mut y = vec![0.0; m * c];
    for row in 0..m {
        let mut mean = 0.0f64;
        for i in 0..c {
            mean += f64::from(x[row * c + i]);
        }
        mean /= c as f64;
        let mut variance = 0.0f64;
        for i in 0..c {
            variance += (f64::from(x[row * c + i]) - mean).powi(2);
        }
        variance /= c as f64;
        for i in 0..c {
            let normal = (f64::from(x[row * c + i]) - mean) / (variance + f64::from(eps)).sqrt();
            let scaled = normal * weight.map_or(1.0, |w| f64::from(w[i])) + bias.map_or(0.0, |b| f64::from(b[i]));
            y[row * c + i] = act.apply(scaled) as f32;
        }
    }
    y
}
