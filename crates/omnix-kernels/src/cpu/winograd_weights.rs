//! Oracle of `winograd_weights`.

use crate::cpu::conv2d_weights;
use crate::winograd_weights::WinogradWeights;

/// The sum over pixels that the algorithm replaces: see [`conv2d_weights`].
///
/// # Panics
/// When a slice is shorter than the specification says.
#[must_use]
pub fn winograd_weights(spec: &WinogradWeights, x: &[f32], dy: &[f32]) -> (Vec<f32>, Vec<f32>) {
    conv2d_weights(&spec.conv, x, dy)
}
