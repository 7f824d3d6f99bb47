//! Training: the objective against recorded values and gradients, several processes together, and settings of a recipe.

mod golden;
mod masked;
mod peers;
mod settings;
mod support;
mod terms;
