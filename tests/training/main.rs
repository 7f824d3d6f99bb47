//! Training: the objective against recorded values and gradients.

mod golden;
mod masked;
mod support;
mod terms;
