//! The oracles: one plain loop a kernel, f64 sums, no sharing with the GPU side but the specification.
//! They are what the kernels are tested against, not a fallback.

mod linear;

pub use linear::linear;
