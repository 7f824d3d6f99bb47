//! Training: the objective against recorded values and gradients, and several processes together.

mod golden;
mod masked;
mod peers;
mod support;
mod terms;
