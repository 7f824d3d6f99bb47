//! The oracles: one plain loop a kernel, f64 sums, no sharing with the GPU side but the specification.
//! They are what the kernels are tested against, not a fallback.

mod attention;
mod layer_norm;
mod linear;
mod reduce;
mod softmax;
mod split_heads;

pub use attention::attention;
pub use layer_norm::layer_norm;
pub use linear::linear;
pub use reduce::reduce;
pub use softmax::softmax;
pub use split_heads::split_heads;
