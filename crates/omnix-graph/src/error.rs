//! What can go wrong between recording a graph and running it.

use omnix_kernels::KernelError;

use crate::graph::value::Shape;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// Two shapes that do not fit an operation.
    #[error("{op}: `{value}` has shape {got}, expected {expected}")]
    Shape {
        /// The operation.
        op: &'static str,
        /// The value's name.
        value: String,
        /// What the operation needs.
        expected: String,
        /// What it was given.
        got: Shape,
    },
    /// Arguments that do not make an operation, whatever their shapes.
    #[error("{op}: {reason}")]
    Arguments {
        /// The operation.
        op: &'static str,
        /// What is wrong with them.
        reason: String,
    },
    /// A tensor larger than the device's largest buffer.
    #[error(
        "`{value}` {shape} takes {bytes} bytes, more than the largest buffer of this device ({limit}); use fewer or smaller images"
    )]
    TensorTooLarge {
        /// The value's name.
        value: String,
        /// Its shape.
        shape: Shape,
        /// Its size.
        bytes: u64,
        /// The device's limit.
        limit: u64,
    },
    /// The budget cannot be met with the smallest chunks.
    #[error("the memory budget of {budget} bytes is too small: at least {least} bytes are needed")]
    Budget {
        /// What was allowed.
        budget: u64,
        /// The least that works.
        least: u64,
    },
    /// An operation that a gradient cannot pass.
    #[error("{op}: there is no derivative of it that training uses")]
    NotDifferentiable {
        /// The operation.
        op: &'static str,
    },
    /// A name that is no input, output or value of the graph.
    #[error("the graph has no value named `{name}`")]
    NoSuchValue {
        /// The name asked for.
        name: String,
    },
    /// Data of the wrong length for an input.
    #[error("input `{name}` takes {expected} numbers, got {got}")]
    InputLength {
        /// The input.
        name: String,
        /// Numbers it holds.
        expected: usize,
        /// Numbers given.
        got: usize,
    },
    /// A parameter that could not be read.
    #[error("weight `{name}` cannot be read")]
    Parameter {
        /// The parameter.
        name: String,
        /// Why.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A weight that is finite, and would be infinite as the plan stores it.
    #[error("weight `{name}{place:?}` = {value} does not fit in f16; store it as f32")]
    DoesNotFit {
        /// The parameter.
        name: String,
        /// Its indices in the tensor of the checkpoint.
        place: Vec<usize>,
        /// What it is.
        value: f32,
    },
    /// A kernel could not be recorded or run.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The caller asked to stop between two pieces of work.
    #[error("interrupted")]
    Interrupted,
}

/// An error for an operation whose kernel takes fewer rows, columns or elements than asked.
pub(crate) fn too_large(kernel: &'static str, n: usize) -> KernelError {
    KernelError::Unsupported {
        kernel,
        reason: format!("{n} elements exceed 32-bit indices; use fewer or smaller images"),
    }
}

/// A size as kernels take it.
pub(crate) fn u32_of(kernel: &'static str, n: usize) -> Result<u32, KernelError> {
    u32::try_from(n).map_err(|_| too_large(kernel, n))
}
