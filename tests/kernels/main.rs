//! Every kernel, every variant the device can run, against its oracle over many shapes.

mod layout;
mod linear;
