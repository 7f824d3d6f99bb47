//! Oracle of `pack`.

use crate::PackedWeights;
use crate::pack::Order;
use crate::winograd::transform;

/// The packed bytes of the matrix whose weights lie in `x` in this order.
#[must_use]
pub fn pack(weights: PackedWeights, order: Order, x: &[f32]) -> Vec<u8> {
    weights.pack(|k, n| x[order.index(k, n)])
}

/// The packed bytes of kernels of 3 x 3, whose taps lie in `x` in this order, transformed for Winograd's algorithm.
#[must_use]
pub fn pack_winograd(weights: PackedWeights, order: Order, x: &[f32]) -> Vec<u8> {
    let channels = order.k_lo as usize;
    weights.pack(|k, n| {
        let (place, channel) = (k / channels, k % channels);
        transform(std::array::from_fn(|tap| x[order.index(tap * channels + channel, n)]))[place]
    })
}
