//! Oracle of `winograd`.

use crate::cpu::conv2d;
use crate::winograd::Winograd;

/// The sum over taps that the algorithm replaces, with the weights of that sum: see [`conv2d`].
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn winograd(
    spec: &Winograd,
    x: &[f32],
    w: &dyn Fn(usize, usize) -> f32,
    bias: &[f32],
    residual: &[f32],
    residual2: &[f32],
) -> Vec<f32> {
    conv2d(&spec.conv, x, w, bias, residual, residual2)
}
