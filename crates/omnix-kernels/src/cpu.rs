//! The oracles: one plain loop a kernel, f64 sums, no sharing with the GPU side but the specification.
//! They are what the kernels are tested against, not a fallback.

mod conv2d;
mod copy;
mod linear;
mod pointwise;
mod resize;
mod swiglu;

pub use conv2d::conv2d;
pub use copy::copy;
pub use linear::linear;
pub use pointwise::{pointwise, unary};
pub use resize::resize;
pub use swiglu::swiglu;
