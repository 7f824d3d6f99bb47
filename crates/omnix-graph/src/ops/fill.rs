//! A value made of one constant: the ground of what is assembled in zeros, the first gradient of a loss.

use omnix_kernels::{KernelError, fill};

use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// A constant, as often as the output's shape says.
#[derive(Clone, Debug)]
pub struct Fill {
    /// The bits of each element.
    pub value: u32,
}

impl<O: Operation + From<Fill>> Graph<O> {
    /// A value of `shape` whose every element is `value`.
    pub fn fill(&mut self, shape: impl Into<Shape>, value: f32) -> Value {
        self.push_one(Fill { value: value.to_bits() }, shape)
    }

    /// As [`Graph::fill`] with an integer.
    pub fn fill_u32(&mut self, shape: impl Into<Shape>, value: u32) -> Value {
        self.push_one(Fill { value }, shape)
    }
}

impl Operation for Fill {
    fn name(&self) -> &'static str {
        "fill"
    }

    fn map_inputs(&mut self, _: &mut dyn FnMut(Value) -> Value) {}

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let y = site.outputs[0];
        let spec = fill::Fill { first: 0, n: site.values.shape(y).elements() as u64, value: self.value };
        site.call([Some(y)], spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
