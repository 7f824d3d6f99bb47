//! One step of AdamW: weights and moments change in place, in buffers of the host's.

use omnix_kernels::{KernelError, adamw};
use smallvec::SmallVec;

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Source, Value, Values};

/// One step of AdamW.
#[derive(Clone, Debug)]
pub struct AdamW {
    /// Weights, and the means of gradients and of their squares: inputs, which the step writes.
    pub state: [Value; 3],
    /// Gradient, in the shape of the weights.
    pub gradient: Value,
    /// `[4]` of [`adamw::AdamW::rates`].
    pub rates: Value,
    /// `[4]` of [`super::GradNorm`].
    pub clip: Option<Value>,
    /// Shares of the old means.
    pub betas: [f64; 2],
    /// Added to the root of the second mean.
    pub eps: f32,
    /// What the gradient is multiplied by where there is no clip.
    pub scale: f32,
}

impl<O: Operation + From<AdamW>> Graph<O> {
    /// Changes weights and moments, which are inputs, as a step of AdamW does.
    ///
    /// # Errors
    /// When the state is not made of inputs, shapes differ, rates or clip have fewer than four numbers, or the kernel refuses a constant.
    pub fn adamw(&mut self, step: &AdamW) -> Result<(), GraphError> {
        let op = "adamw";
        let shape = self.shape(step.state[0]).clone();
        for value in step.state.into_iter().chain([step.gradient]) {
            self.expect(op, value, &shape)?;
        }
        for value in step.state {
            if !matches!(self.info(value).source, Source::Input) {
                return Err(self.misfit(op, value, "an input, which outlives a run"));
            }
        }
        for value in [Some(step.rates), step.clip].into_iter().flatten() {
            if self.shape(value).elements() < adamw::RATES_WORDS as usize {
                return Err(self.misfit(op, value, "[4]"));
            }
        }
        // A node has a result: this one is never written.
        self.push_one(step.clone(), Shape::from([1]));
        Ok(())
    }
}

impl Operation for AdamW {
    fn name(&self) -> &'static str {
        "adamw"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { state, gradient, rates, clip, .. } = self;
        map_all(state.iter_mut().chain([gradient, rates]).chain(clip), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { state, gradient, rates, clip, betas, eps, scale } = *self;
        let n = site.values.shape(gradient).elements();
        let spec = adamw::AdamW { n: n as u64, betas, eps, scale, clip: clip.is_some() };
        site.call(state.into_iter().map(Some).chain([Some(gradient), Some(rates), clip]), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        14 * values.shape(self.gradient).elements() as u64
    }

    fn writes(&self) -> SmallVec<[Value; 4]> {
        SmallVec::from_slice(&self.state)
    }
}
