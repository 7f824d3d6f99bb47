//! A plan on a device with weights that stay: bind groups, and the encoding of a run.

use std::ops::{ControlFlow, Deref, Range};

use omnix_kernels::{Gpu, Program};

use super::store::WeightStore;
use super::tensors::{Bindings, Tensors};
use crate::error::GraphError;
use crate::plan::record::{Recorded, record};
use crate::plan::{Plan, node_flops};

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

/// The dispatches of one kernel call.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// The node they belong to; in a chain a node has a piece for every chunk.
    pub(crate) node: usize,
    pub(crate) dispatches: Range<usize>,
    /// The piece's share of the node's operations.
    pub(crate) flops: u64,
}

/// About as many operations go into one submission: half a second on a slow software device.
const FLOPS_PER_SUBMIT: u64 = 10_000_000_000;

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

    /// Runs in submissions of moderate length and waits. After each, `progress` is called with the operations submitted so far and
    /// those of the whole run, and may break off. The device then has work, so what the host does there costs no time of its own.
    ///
    /// # Errors
    /// When the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    pub fn run(&self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Result<(), GraphError> {
        let mut submissions = Submissions::new(&self.tensors, progress);
        submissions.submit(&self.program, &self.pieces)?;
        submissions.finish()
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

/// A run on its way: pieces in submissions of moderate length, of which one is in flight while the next is recorded.
pub(crate) struct Submissions<'a> {
    gpu: &'a Gpu,
    in_flight: Option<wgpu::SubmissionIndex>,
    done: u64,
    total: u64,
    progress: &'a mut dyn FnMut(u64, u64) -> ControlFlow<()>,
}

impl<'a> Submissions<'a> {
    pub(crate) fn new(tensors: &'a Tensors, progress: &'a mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Self {
        Self { gpu: tensors.gpu(), in_flight: None, done: 0, total: tensors.plan().flops(), progress }
    }

    /// Submits all of `program`. When this returns, at most its last submission is not done.
    pub(crate) fn submit(&mut self, program: &Program, pieces: &[Piece]) -> Result<(), GraphError> {
        let first = pieces.first().map_or(0, |piece| piece.dispatches.start);
        let mut batch = first..first;
        let mut flops = 0;
        for (i, piece) in pieces.iter().enumerate() {
            batch.end = piece.dispatches.end;
            flops += piece.flops;
            if flops < FLOPS_PER_SUBMIT && i + 1 < pieces.len() {
                continue;
            }
            let submitted = submit(self.gpu, program, batch.clone());
            if let Some(before) = self.in_flight.replace(submitted) {
                self.gpu.wait_for(before)?;
            }
            self.done += flops;
            if self.listen().is_break() {
                self.gpu.wait()?;
                return Err(GraphError::Interrupted);
            }
            batch.start = batch.end;
            flops = 0;
        }
        Ok(())
    }

    /// Reports how far the run is, and returns whether to go on.
    pub(crate) fn listen(&mut self) -> ControlFlow<()> {
        (self.progress)(self.done.min(self.total), self.total)
    }

    /// Waits for the end.
    pub(crate) fn finish(self) -> Result<(), GraphError> {
        Ok(self.gpu.wait()?)
    }
}

fn submit(gpu: &Gpu, program: &Program, dispatches: Range<usize>) -> wgpu::SubmissionIndex {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        program.encode(&mut pass, dispatches);
    }
    gpu.queue.submit([encoder.finish()])
}

/// What kernel calls of `plan` come to; their dispatches count from the first of them.
pub(crate) fn pieces(plan: &Plan, recorded: &[Recorded]) -> Vec<Piece> {
    let mut calls = vec![0u64; plan.graph.nodes.len()];
    recorded.iter().for_each(|call| calls[call.node] += 1);
    let mut at = 0;
    recorded
        .iter()
        .map(|call| {
            let dispatches = at..at + call.dispatches.len();
            at = dispatches.end;
            Piece { node: call.node, dispatches, flops: node_flops(&plan.graph, call.node) / calls[call.node] }
        })
        .collect()
}
