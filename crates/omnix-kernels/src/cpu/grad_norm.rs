//! Oracle of `grad_norm`.

use crate::grad_norm::Clip;

/// `[scale · min(1, max_norm / (norm + 1e-6)), norm, bad, 0]` of all gradients.
#[must_use]
pub fn grad_norm(spec: &Clip, gradients: &[&[f32]]) -> [f32; 4] {
    let scaled = |v: &f32| f64::from(*v) * f64::from(spec.scale);
    let squares: f64 = gradients.iter().flat_map(|g| g.iter()).map(|v| scaled(v) * scaled(v)).sum();
    let norm = squares.sqrt();
    // What f32 cannot hold as a sum of squares counts as infinite.
    if !(squares as f32).is_finite() {
        return [0.0, (squares as f32).sqrt(), 1.0, 0.0];
    }
    let factor = f64::from(spec.scale) * (f64::from(spec.max_norm) / (norm + 1e-6)).min(1.0);
    [factor as f32, norm as f32, 0.0, 0.0]
}
