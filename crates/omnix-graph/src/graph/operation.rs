//! What every operation states about itself, and what it is told when it becomes kernel calls.

use omnix_kernels::{Caps, Dispatch, KernelError, WeightType};
use smallvec::SmallVec;

use super::rows::RowWise;
use super::storage::Packing;
use super::value::Value;
use super::values::Values;
use crate::error::{too_large, u32_of};

/// One operation with its arguments. Its shape rule is the method of [`super::Graph`] that records it, in the same file.
pub trait Operation: Clone {
    /// The operation's name in messages, plans and traces: that of its kernel.
    fn name(&self) -> &'static str;

    /// Replaces every value the operation reads, parameters and constants included.
    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value);

    /// The kernel calls that compute it, for all rows or for a chunk of them.
    ///
    /// # Errors
    /// When a kernel cannot take the shapes.
    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError>;

    /// Floating-point operations (a multiply-add is two); 0 for what only moves numbers.
    fn flops(&self, values: &Values, outputs: &[Value]) -> u64;

    /// How it works row by row, if it does.
    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        let _ = values;
        None
    }

    /// How the parameter `value` that it reads lies on the device when matrices are stored as `storage`.
    fn packing(&self, values: &Values, value: Value, storage: WeightType) -> Packing {
        let _ = (values, value, storage);
        Packing::Plain
    }

    /// Values that its kernel reads through 64 KiB uniform windows on some devices: their buffers have a spare window at the end.
    fn windowed(&self, outputs: &[Value]) -> SmallVec<[Value; 2]> {
        let _ = outputs;
        SmallVec::new()
    }

    /// Inputs of the graph that the operation changes in place. Such a node runs although nothing reads its result.
    fn writes(&self) -> SmallVec<[Value; 4]> {
        SmallVec::new()
    }

    /// Every value the operation reads, parameters and constants included.
    fn inputs(&self) -> SmallVec<[Value; 8]> {
        let mut copy = self.clone();
        let mut found = SmallVec::new();
        copy.map_inputs(&mut |v| {
            found.push(v);
            v
        });
        found
    }
}

/// Applies `map` to each of `values` in order.
pub(crate) fn map_all<'a>(values: impl IntoIterator<Item = &'a mut Value>, map: &mut dyn FnMut(Value) -> Value) {
    values.into_iter().for_each(|v| *v = map(*v));
}

/// One kernel call: arguments in the order of the kernel's `Arg` constants.
#[derive(Clone, Debug)]
pub struct Call {
    /// The value of each argument; absent ones are not bound.
    pub args: SmallVec<[Option<Value>; 8]>,
    /// What the kernel recorded.
    pub dispatches: Vec<Dispatch>,
}

/// Where an operation is lowered: its values and the device, all rows or a chunk of them.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// The operation's name, for errors.
    pub name: &'static str,
    /// The graph's values.
    pub values: &'a Values,
    /// The node's results.
    pub outputs: &'a [Value],
    /// The device's facts.
    pub caps: &'a Caps,
    /// How matrices are stored.
    pub storage: WeightType,
    /// Rows of a chunk; `None` when the node runs whole.
    pub chunk: Option<usize>,
}

impl Site<'_> {
    /// A size as kernels take it.
    pub(crate) fn n(&self, n: usize) -> Result<u32, KernelError> {
        u32_of(self.name, n)
    }

    /// The product of sizes as kernels take it.
    pub(crate) fn product(&self, dims: &[usize]) -> Result<u32, KernelError> {
        let product = dims.iter().try_fold(1usize, |all, d| all.checked_mul(*d));
        self.n(product.ok_or_else(|| too_large(self.name, usize::MAX))?)
    }

    /// Rows of `value`, or of the chunk.
    pub(crate) fn rows(&self, value: Value) -> Result<u32, KernelError> {
        self.n(self.chunk.unwrap_or_else(|| self.values.shape(value).rows()))
    }

    /// Elements of a row of `value`.
    pub(crate) fn width(&self, value: Value) -> Result<u32, KernelError> {
        self.n(self.values.shape(value).width())
    }

    /// Elements of `value`, or of the chunk's rows of it.
    pub(crate) fn elements(&self, value: Value) -> usize {
        let shape = self.values.shape(value);
        self.chunk.map_or_else(|| shape.elements(), |rows| rows * shape.width())
    }

    /// Groups and members of one: whole groups in a chunk, or part of the only one.
    pub(crate) fn groups(&self, groups: usize, members: usize) -> (usize, usize) {
        match self.chunk {
            None => (groups, members),
            Some(rows) if groups == 1 => (1, rows),
            Some(rows) => (rows / members, members),
        }
    }

    /// A single kernel call, as most operations are.
    pub(crate) fn call(
        &self,
        args: impl IntoIterator<Item = Option<Value>>,
        dispatches: Vec<Dispatch>,
    ) -> Result<Vec<Call>, KernelError> {
        Ok(vec![Call { args: args.into_iter().collect(), dispatches }])
    }
}
