//! Every kernel, every variant the device can run, against its oracle over many shapes.

mod attention;
mod layer_norm;
mod layout;
mod linear;
mod reduce;
mod softmax;
mod split_heads;
