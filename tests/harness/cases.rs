//! One list of cases per kernel: its test compares them with the oracle, its bench measures those that networks have, and a
//! gradient check can start from the same inputs.

pub mod adamw;
pub mod attention;
pub mod attention_grad_kv;
pub mod attention_grad_q;
pub mod blend;
pub mod conv2d;
pub mod conv2d_weights;
pub mod copy;
pub mod deform_sample;
pub mod deform_sample_grad;
pub mod deform_sample_grad_field;
pub mod dropout;
pub mod field_scatter;
pub mod field_scatter_grad;
pub mod fill;
pub mod gather;
pub mod grad_norm;
pub mod layer_norm;
pub mod layer_norm_grad;
pub mod linear;
pub mod linear_weights;
pub mod pack;
pub mod pointwise;
pub mod rank;
pub mod reduce;
pub mod reference_view;
pub mod resize;
pub mod resize_grad;
pub mod scatter;
pub mod softmax;
pub mod splat;
pub mod split_heads;
pub mod split_heads_grad;
pub mod swiglu;
pub mod swiglu_grad;
pub mod token_expand;
pub mod token_expand_grad;
pub mod top_k;
pub mod traj_apply;
pub mod traj_apply_grad;
pub mod trajectory;
pub mod winograd;
pub mod winograd_weights;

mod case;

pub use case::{Call, Case, Changed, Values, Work, check_all, computed, computed_from, results};
