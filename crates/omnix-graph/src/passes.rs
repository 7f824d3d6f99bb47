//! From graph to graph, before memory is planned: gradients, fusion, what is computed once, which algorithm computes a
//! convolution, what is computed again instead of kept.

pub mod adopt;
pub(crate) mod algorithm;
mod differentiate;
pub(crate) mod fixed;
pub mod fuse;
pub(crate) mod recompute;
