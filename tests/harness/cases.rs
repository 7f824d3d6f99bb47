//! One list of cases per kernel: its test compares them with the oracle, its bench measures those that networks have, and a
//! gradient check can start from the same inputs.

pub mod attention;
pub mod conv2d;
pub mod copy;
pub mod deform_sample;
pub mod field_scatter;
pub mod gather;
pub mod layer_norm;
pub mod linear;
pub mod pointwise;
pub mod reduce;
pub mod reference_view;
pub mod resize;
pub mod scatter;
pub mod softmax;
pub mod split_heads;
pub mod swiglu;
pub mod token_expand;
pub mod top_k;
pub mod traj_apply;
pub mod trajectory;
pub mod winograd;

mod case;

pub use case::{Call, Case, Changed, Values, Work, check_all, computed, computed_from, results};
