//! The oracles: one plain loop per kernel, f64 sums, no sharing with the GPU side but the specification.
//! They are what the kernels are tested against, not a fallback.

mod attention;
mod conv2d;
mod copy;
mod deform_sample;
mod field_scatter;
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
mod token_expand;
mod top_k;
mod traj_apply;
mod trajectory;
mod winograd;

pub use attention::attention;
pub use conv2d::conv2d;
pub use copy::copy;
pub use deform_sample::{Sampled, deform_sample};
pub use field_scatter::field_scatter;
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
pub use token_expand::token_expand;
pub use top_k::top_k;
pub use traj_apply::traj_apply;
pub use trajectory::trajectory;
pub use winograd::winograd;
