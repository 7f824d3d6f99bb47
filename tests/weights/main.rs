//! Checkpoints: opening, conversion, names, the check against a manifest, and damaged files.

mod check;
mod convert;
mod corrupt;
mod fixture;
mod open;
