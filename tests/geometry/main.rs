//! Geometry against the recorded goldens of Depth Anything 3: small copies in `tests/data/geometry`, and the full files of
//! `../shared/golden` when they are there; joins of windows against made scenes.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod fixture;
mod join;
mod poses;
mod position;
mod rays;
