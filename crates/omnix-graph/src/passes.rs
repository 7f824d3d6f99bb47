//! From graph to graph, before memory is planned: fusion, what is computed once, which algorithm computes a convolution.

pub(crate) mod algorithm;
pub(crate) mod fixed;
pub mod fuse;
