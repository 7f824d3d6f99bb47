//! Which view is the reference: order of views with the reference first, its inverse, and the reference's index.

use omnix_kernels::KernelError;
use omnix_kernels::reference_view::{self, Strategy};

use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The choice of a reference among class tokens.
#[derive(Clone, Debug)]
pub struct ReferenceView {
    /// Class tokens `[views, c]`.
    pub x: Value,
    /// How to choose.
    pub strategy: Strategy,
}

impl<O: Operation + From<ReferenceView>> Graph<O> {
    /// Picks the reference among class tokens `[views, c]`: `(order, inverse, reference)`, u32, `order[0]` the reference.
    ///
    /// # Errors
    /// When `x` is not a matrix.
    pub fn reference_view(&mut self, x: Value, strategy: Strategy) -> Result<(Value, Value, Value), GraphError> {
        let [views, _] = **self.shape(x) else { return Err(self.misfit("reference_view", x, "[views, channels]")) };
        let shapes = [Shape::from([views]), Shape::from([views]), Shape::from([1])];
        let outputs = self.push(ReferenceView { x, strategy }, shapes);
        Ok((outputs[0], outputs[1], outputs[2]))
    }
}

impl Operation for ReferenceView {
    fn name(&self) -> &'static str {
        "reference_view"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let shape = site.values.shape(self.x);
        let spec =
            reference_view::ReferenceView { s: site.n(shape[0])?, c: site.n(shape[1])?, strategy: self.strategy };
        let [order, inverse, reference] = [site.outputs[0], site.outputs[1], site.outputs[2]];
        site.call([self.x, order, inverse, reference].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
