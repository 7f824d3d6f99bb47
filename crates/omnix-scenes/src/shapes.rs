//! Shapes to build things from. Lengths in metres, z up; what a function centres it says.

mod flat;
mod round;
mod sheet;

pub(crate) use flat::{block, cuboid, frame, prism, rounded};
pub(crate) use round::{capsule, cone, cylinder, lathe, rock, sphere, superquadric, torus, tube};
pub(crate) use sheet::{blade, sheet};
