//! A plan on a device whose weights do not stay there: while one stretch of the plan runs, the weights of the next are read,
//! packed and written. At most two stretches' weights are on the device, so a network may be larger than its memory.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::ControlFlow;
use std::ops::Deref;

use omnix_kernels::Gpu;

use super::run::{Calls, Run, pieces};
use super::source::ParameterSource;
use super::tensors::{Bindings, Tensors};
use crate::error::GraphError;
use crate::plan::Plan;
use crate::plan::record::record;
use crate::plan::stretch::stretches;

/// A plan with its memory on a device, but for its weights, which pass through while it runs. For plans that run once: every
/// run reads the weights again.
#[derive(Debug)]
pub struct Streamed {
    tensors: Tensors,
    stretches: Vec<Calls>,
}

impl Streamed {
    /// Allocates the buffers of a plan made for passing weights ([`crate::PlanOptions::streamed`]) and makes its pipelines.
    ///
    /// # Errors
    /// As [`crate::Executable::new`].
    pub fn new(gpu: &Gpu, plan: Plan, bindings: &Bindings) -> Result<Self, GraphError> {
        debug_assert!(plan.streamed, "BUG: a plan for weights that stay");
        let mut recorded = record(&plan)?;
        for dispatch in recorded.iter().flat_map(|call| &call.dispatches) {
            gpu.prepare(dispatch)?;
        }
        let mut made = Vec::new();
        for stretch in stretches(&plan.graph, &plan.segments, plan.parts, plan.storage) {
            let rest = recorded.split_off(recorded.partition_point(|call| call.node < stretch.nodes.end));
            let recorded = std::mem::replace(&mut recorded, rest);
            made.push(Calls { weights: stretch.weights, pieces: pieces(&plan, &recorded), recorded });
        }
        Ok(Self { tensors: Tensors::new(gpu, plan, bindings)?, stretches: made })
    }

    /// Starts a run with the weights of `source`, which goes on with every [`Run::step`].
    #[must_use]
    pub fn start<'a>(&'a self, source: &'a dyn ParameterSource) -> Run<'a> {
        Run::through(&self.tensors, &self.stretches, source)
    }

    /// Runs with the weights of `source` and waits, blocking; `progress` is told as by [`Run::finish`].
    ///
    /// # Errors
    /// When a weight cannot be read, memory runs out, the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run(
        &self,
        source: &dyn ParameterSource,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<(), GraphError> {
        pollster::block_on(self.start(source).finish(progress))
    }
}

/// Inputs, outputs and the plan.
impl Deref for Streamed {
    type Target = Tensors;

    fn deref(&self) -> &Tensors {
        &self.tensors
    }
}
