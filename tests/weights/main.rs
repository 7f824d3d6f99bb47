//! Tensors and checkpoints: opening, conversion, writing, names, the check against a manifest, verification, damaged files.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod check;
mod convert;
mod corrupt;
mod fixture;
mod open;
mod prefix;
mod pytorch;
mod verify;
mod writer;
