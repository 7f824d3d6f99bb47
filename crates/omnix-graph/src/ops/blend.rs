//! Numbers mixed into others, in place, in buffers of the host's: sums of gradients, averages of weights.

use omnix_kernels::{KernelError, blend};
use smallvec::{SmallVec, smallvec};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Source, Value, Values};

/// `y = shares[0] · y + shares[1] · x`.
#[derive(Clone, Debug)]
pub struct Blend {
    /// An input, which the operation writes.
    pub y: Value,
    /// As many numbers.
    pub x: Value,
    /// `[2]`.
    pub shares: Value,
}

impl<O: Operation + From<Blend>> Graph<O> {
    /// Changes `y`, an input, to `shares[0] · y + shares[1] · x`.
    ///
    /// # Errors
    /// When `y` is no input, or a shape does not fit.
    pub fn blend(&mut self, y: Value, x: Value, shares: Value) -> Result<(), GraphError> {
        let (op, shape) = ("blend", self.shape(y).clone());
        if !matches!(self.info(y).source, Source::Input) {
            return Err(self.misfit(op, y, "an input, which outlives a run"));
        }
        self.expect(op, x, &shape)?;
        self.expect(op, shares, &[2])?;
        // A node has a result: this one is never written.
        self.push_one(Blend { y, x, shares }, Shape::from([1]));
        Ok(())
    }
}

impl Operation for Blend {
    fn name(&self) -> &'static str {
        "blend"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.y, &mut self.x, &mut self.shares], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = blend::Blend { n: site.values.shape(self.x).elements() as u64 };
        site.call([self.y, self.x, self.shares].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        3 * values.shape(self.x).elements() as u64
    }

    fn writes(&self) -> SmallVec<[Value; 4]> {
        smallvec![self.y]
    }
}
