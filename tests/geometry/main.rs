//! Geometry against the recorded goldens of Depth Anything 3: small copies in `tests/data/geometry`, and the full files of
//! `../shared/golden` when they are there.

mod fixture;
mod poses;
mod position;
mod rays;
