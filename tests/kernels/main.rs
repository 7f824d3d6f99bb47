//! Every kernel, every variant the device can run, against its oracle over many shapes.

mod conv2d;
mod copy;
mod layout;
mod linear;
mod pointwise;
mod resize;
mod swiglu;
