//! A plan on a device whose weights do not stay there: while one stretch of the plan runs, the weights of the next are read,
//! packed and written. At most two stretches' weights are on the device, so a network may be larger than its memory.

use std::ops::{ControlFlow, Deref};

use omnix_kernels::Gpu;

use super::exec::{Piece, Submissions, pieces};
use super::source::ParameterSource;
use super::store::WeightStore;
use super::tensors::{Bindings, Tensors};
use crate::error::GraphError;
use crate::graph::WeightKey;
use crate::plan::Plan;
use crate::plan::record::{Recorded, record};
use crate::plan::stretch::stretches;

/// A plan with its memory on a device, but for its weights, which pass through while it runs. For plans that run once: every
/// run reads the weights again.
#[derive(Debug)]
pub struct Streamed {
    tensors: Tensors,
    stretches: Vec<Calls>,
}

/// The kernel calls of a stretch.
#[derive(Debug)]
struct Calls {
    weights: Vec<WeightKey>,
    recorded: Vec<Recorded>,
    pieces: Vec<Piece>,
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

    /// Runs with the weights of `source` and waits. `progress` is told as by [`crate::Executable::run`], and when weights are written.
    ///
    /// # Errors
    /// When a weight cannot be read, memory runs out, the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    pub fn run(
        &self,
        source: &dyn ParameterSource,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<(), GraphError> {
        let mut submissions = Submissions::new(&self.tensors, progress);
        for stretch in &self.stretches {
            // The stretch before may still run. The one before that has: its weights were given back when its end was waited for.
            let gpu = self.tensors.gpu();
            let loaded = WeightStore::load(gpu, source, &stretch.weights, &mut |_, _| submissions.listen());
            let ran = loaded.and_then(|store| {
                let program = self.tensors.program(&stretch.recorded, &store)?;
                submissions.submit(&program, &stretch.pieces)
            });
            if ran.is_err() {
                submissions.finish()?;
                return ran;
            }
        }
        submissions.finish()
    }
}

/// Inputs, outputs and the plan.
impl Deref for Streamed {
    type Target = Tensors;

    fn deref(&self) -> &Tensors {
        &self.tensors
    }
}
