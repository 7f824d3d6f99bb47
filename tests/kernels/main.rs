//! Every kernel, every variant the device can run, against its oracle over many shapes.

mod attention;
mod conv2d;
mod copy;
mod deform_sample;
mod field_scatter;
mod gather;
mod layer_norm;
mod layout;
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
