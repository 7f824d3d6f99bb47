//! A plan on a device with weights that stay: bind groups, and the encoding of a run.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::ControlFlow;
use std::ops::Deref;

use omnix_kernels::{Gpu, Program};

use super::run::{Piece, Run, pieces, submit};
use super::store::WeightStore;
use super::tensors::{Bindings, Tensors};
use crate::error::GraphError;
use crate::plan::Plan;
use crate::plan::record::record;

/// A plan with its memory on a device and weights that stay there; run it as often as you like.
#[derive(Debug)]
pub struct Executable {
    tensors: Tensors,
    program: Program,
    /// Dispatches at the front that are done: what does not depend on inputs.
    fixed: usize,
    /// The kernel calls of a run in order.
    pieces: Vec<Piece>,
}

impl Executable {
    /// Allocates the plan's buffers, makes its pipelines and bind groups, and submits what depends on no input.
    ///
    /// # Errors
    /// When memory runs out, a pipeline cannot be made, or a host buffer in `bindings` is too small.
    pub fn new(gpu: &Gpu, plan: Plan, weights: &WeightStore, bindings: &Bindings) -> Result<Self, GraphError> {
        let recorded = record(&plan)?;
        let tensors = Tensors::new(gpu, plan, bindings)?;
        let program = tensors.program(&recorded, weights)?;
        let mut pieces = pieces(tensors.plan(), &recorded);
        let run = pieces.split_off(pieces.partition_point(|piece| piece.node < tensors.plan().fixed));
        let fixed = pieces.last().map_or(0, |piece| piece.dispatches.end);
        if fixed > 0 {
            submit(gpu, &program, 0..fixed);
        }
        Ok(Self { tensors, program, fixed, pieces: run })
    }

    /// Number of dispatches of a run.
    #[must_use]
    pub fn dispatches(&self) -> usize {
        self.program.len() - self.fixed
    }

    /// Records a whole run into the host's encoder.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("omnix"), timestamp_writes: None });
        self.program.encode(&mut pass, self.fixed..self.program.len());
    }

    /// Starts a run, which goes on with every [`Run::step`].
    #[must_use]
    pub fn start(&self) -> Run<'_> {
        Run::of(&self.tensors, &self.program, &self.pieces)
    }

    /// Runs in submissions of moderate length and waits, blocking; `progress` is told as by [`Run::finish`].
    ///
    /// # Errors
    /// When the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run(&self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Result<(), GraphError> {
        pollster::block_on(self.start().finish(progress))
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

/// Inputs, outputs and the plan.
impl Deref for Executable {
    type Target = Tensors;

    fn deref(&self) -> &Tensors {
        &self.tensors
    }
}
