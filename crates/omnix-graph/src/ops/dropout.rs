//! Some numbers left out, others made larger to match.

use omnix_kernels::{KernelError, dropout};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// `x / (1 − p)`, left out (0) with probability p; over the gradient of its result it is its own gradient.
#[derive(Clone, Debug)]
pub struct Dropout {
    /// Operand.
    pub x: Value,
    /// u32; the first is the step.
    pub step: Value,
    /// Probability with which a number is left out.
    pub p: f32,
    /// Of the whole training.
    pub seed: u64,
    /// Tells apart what draws at the same step.
    pub stream: u32,
}

impl<O: Operation + From<Dropout>> Graph<O> {
    /// `x / (1 − p)`, left out with probability `p` by a hash of (seed, step, stream, element): the same numbers whenever it is computed
    /// again. `step` is u32, its first number counts. The gradient is the same of `dy` in place of `x`.
    ///
    /// # Errors
    /// When `p` is not from 0 to below 1, or there is no step.
    pub fn dropout(&mut self, x: Value, step: Value, p: f32, (seed, stream): (u64, u32)) -> Result<Value, GraphError> {
        if !(0.0..1.0).contains(&p) {
            let reason = format!("probability {p}; it is from 0 to below 1");
            return Err(GraphError::Arguments { op: "dropout", reason });
        }
        if self.shape(step).elements() == 0 {
            return Err(self.misfit("dropout", step, "[1]"));
        }
        let shape = self.shape(x).clone();
        Ok(self.push_one(Dropout { x, step, p, seed, stream }, shape))
    }
}

impl Operation for Dropout {
    fn name(&self) -> &'static str {
        "dropout"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x, &mut self.step], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { x, step, p, seed, stream } = *self;
        let spec = dropout::Dropout { n: site.n(site.values.shape(x).elements())?, p, seed, stream };
        site.call([x, step, site.outputs[0]].map(Some), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
