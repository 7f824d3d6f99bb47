//! Tensor graphs: recorded without a device, planned to the byte, then encoded.
//!
//! * [`Graph`]: values with static shapes and a small closed set of operations; shape errors name the
//!   operation, the value and both shapes. Layers record through [`Graph`]'s methods.
//! * [`fuse`]: a pass from graph to graph; what is pointwise moves into its producer or reader.
//! * [`Plan`]: which nodes run in row chunks, which buffer every value lives in, how many bytes and
//!   operations a run takes: all known before anything runs, with no device.
//! * [`Work`]: what a run asks of a device, counted without one.
//! * [`Executable`]: the plan on a borrowed device; [`Streamed`]: the same with weights that pass through while it runs.
//!   Both are [`Tensors`]: inputs to write, outputs to read.

mod algorithm;
pub mod build;
pub mod error;
pub mod exec;
mod fixed;
pub mod fuse;
pub mod graph;
mod lower;
pub mod memory;
pub mod op;
pub mod plan;
pub mod profile;
mod record;
pub mod rows;
pub mod schedule;
pub mod stream;
pub mod tensors;
mod upload;
pub mod weights;
pub mod work;

pub use error::GraphError;
pub use exec::Executable;
pub use graph::{Graph, Parameter, Shape, Value};
pub use op::Op;
pub use plan::{Plan, PlanOptions};
pub use stream::Streamed;
pub use tensors::{Bindings, Tensors};
pub use weights::{ParameterSource, WeightStore};
pub use work::Work;
