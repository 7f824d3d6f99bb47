//! Checkpoints: opening, conversion, names, the check against a manifest, and damaged files.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod check;
mod convert;
mod corrupt;
mod fixture;
mod open;
