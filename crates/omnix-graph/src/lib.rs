//! Tensor graphs: recorded without a device, planned to the byte, then encoded. Three floors, each knowing those above it:
//!
//! * **say**: [`graph`] (values with static shapes, nodes, and what every operation states) and [`ops`] (the closed set
//!   of operations, one file each). Layers record through the methods of [`Graph`]; shape errors name the operation, the
//!   value and both shapes.
//! * **decide**: [`passes`] (from graph to graph: what is pointwise moves into its producer or reader) and [`plan`] (which nodes
//!   run in row chunks, which buffer every value lives in, how many bytes and operations a run takes). All of it is known
//!   before anything runs, with no device. [`Work`]: what a run asks of a device, counted without one.
//! * **do**: [`device`] ([`Executable`]: the plan on a borrowed device; [`Streamed`]: the same with weights that pass through
//!   while it runs. Both are [`Tensors`]: inputs to write, outputs to read).

pub mod device;
pub mod error;
pub mod graph;
pub mod ops;
pub mod passes;
pub mod plan;

pub use device::exec::Executable;
#[cfg(not(target_arch = "wasm32"))]
pub use device::profile;
pub use device::run::{Run, Step};
pub use device::source::ParameterSource;
pub use device::store::WeightStore;
pub use device::stream::Streamed;
pub use device::tensors::{Bindings, Tensors};
pub use error::GraphError;
pub use graph::{Operation, Parameter, Shape, Value, WeightKey};
pub use ops::{Graph, Node, Op};
pub use plan::work::Work;
pub use plan::{Plan, PlanOptions};
