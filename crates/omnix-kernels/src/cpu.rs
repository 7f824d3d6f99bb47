//! The oracles: one plain loop a kernel, f64 sums, no sharing with the GPU side but the specification.
//! They are what the kernels are tested against, not a fallback.

mod attention;
mod conv2d;
mod copy;
mod gather;
mod layer_norm;
mod linear;
mod pointwise;
mod reduce;
mod reference_view;
mod resize;
mod scatter;
mod softmax;
mod split_heads;
mod swiglu;
mod top_k;

pub use attention::attention;
pub use conv2d::conv2d;
pub use copy::copy;
pub use gather::gather;
pub use layer_norm::layer_norm;
pub use linear::linear;
pub use pointwise::{pointwise, unary};
pub use reduce::reduce;
pub use reference_view::{reference_view, reference_view_scores};
pub use resize::resize;
pub use scatter::scatter;
pub use softmax::softmax;
pub use split_heads::split_heads;
pub use swiglu::swiglu;
pub use top_k::top_k;
