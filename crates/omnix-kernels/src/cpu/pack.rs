//! Oracle of `pack`.

use crate::PackedWeights;
use crate::pack::Order;

/// The packed bytes of the matrix whose weights lie in `x` in this order.
#[must_use]
pub fn pack(weights: PackedWeights, order: Order, x: &[f32]) -> Vec<u8> {
    weights.pack(|k, n| x[order.index(k, n)])
}
