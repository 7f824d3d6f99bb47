//! The places of scenes: each function puts one together on a stage.

mod field;
mod room;
mod street;
mod studio;
mod walls;

pub(crate) use field::field;
pub(crate) use room::{desk, room};
pub(crate) use street::street;
pub(crate) use studio::studio;
