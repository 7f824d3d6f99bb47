//! A run on its way, one submission at a time.

use std::fmt;
use std::ops::{ControlFlow, Range};

use omnix_kernels::{Gpu, Program};

use super::source::ParameterSource;
use super::store::WeightStore;
use super::tensors::Tensors;
use crate::error::GraphError;
use crate::graph::WeightKey;
use crate::plan::record::Recorded;
use crate::plan::{Plan, node_flops};

/// About as many operations go into one submission: half a second on a slow software device.
const FLOPS_PER_SUBMIT: u64 = 10_000_000_000;

/// A run on its way: submissions of moderate length, of which one is in flight while the next is recorded. A caller that does not want
/// the rest calls [`Run::stop`].
pub struct Run<'a> {
    tensors: &'a Tensors,
    /// What is being submitted.
    current: Option<Loaded<'a>>,
    /// What comes after, with weights of their own.
    rest: std::slice::Iter<'a, Calls>,
    source: Option<&'a dyn ParameterSource>,
    in_flight: Option<wgpu::SubmissionIndex>,
    done: u64,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Operations submitted so far.
    pub done: u64,
    /// Operations of the whole run.
    pub total: u64,
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

/// The kernel calls of a stretch of a plan, and the weights that they read.
#[derive(Debug)]
pub(crate) struct Calls {
    pub(crate) weights: Vec<WeightKey>,
    pub(crate) recorded: Vec<Recorded>,
    pub(crate) pieces: Vec<Piece>,
}

/// Kernel calls that are ready, and those of them that are still to be submitted.
#[derive(Debug)]
struct Loaded<'a> {
    program: Ready<'a>,
    pieces: &'a [Piece],
}

#[derive(Debug)]
enum Ready<'a> {
    /// Made before the run.
    Kept(&'a Program),
    /// Made for it; what it reads lives as long.
    Passing(Program),
}

impl fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Run").field("done", &self.done).finish_non_exhaustive()
    }
}

impl<'a> Run<'a> {
    /// Of kernel calls whose weights stay.
    pub(crate) fn of(tensors: &'a Tensors, program: &'a Program, pieces: &'a [Piece]) -> Self {
        let current = Some(Loaded { program: Ready::Kept(program), pieces });
        Self { tensors, current, rest: [].iter(), source: None, in_flight: None, done: 0 }
    }

    /// Of stretches, with the weights of `source`.
    pub(crate) fn through(tensors: &'a Tensors, stretches: &'a [Calls], source: &'a dyn ParameterSource) -> Self {
        Self { tensors, current: None, rest: stretches.iter(), source: Some(source), in_flight: None, done: 0 }
    }

    /// Submits the next part and waits for the one before, or writes the weights that the next part reads; `None` when everything has run.
    /// The device has work when this returns, so what the host does then costs no time of its own.
    ///
    /// # Errors
    /// When the device is lost, a weight cannot be read or memory runs out; nothing of the run is in flight then.
    pub async fn step(&mut self) -> Result<Option<Step>, GraphError> {
        let step = self.next().await;
        if step.is_err() {
            self.stop().await?;
        }
        step
    }

    async fn next(&mut self) -> Result<Option<Step>, GraphError> {
        if self.current.as_ref().is_none_or(|current| current.pieces.is_empty()) {
            // The weights that are in use go with the submission that reads them, when its end is waited for.
            self.current = None;
            let Some(calls) = self.rest.next() else {
                self.stop().await?;
                return Ok(None);
            };
            self.current = Some(self.load(calls).await?);
            return Ok(Some(self.reached()));
        }
        let gpu = self.tensors.gpu();
        let Some(current) = &mut self.current else { return Ok(None) };
        let (dispatches, flops) = current.take();
        let program = match &current.program {
            Ready::Kept(program) => program,
            Ready::Passing(program) => program,
        };
        let submitted = submit(gpu, program, dispatches);
        if let Some(before) = self.in_flight.replace(submitted) {
            gpu.wait_for_async(before).await?;
        }
        self.done += flops;
        Ok(Some(self.reached()))
    }

    fn reached(&self) -> Step {
        let total = self.tensors.plan().flops();
        Step { done: self.done.min(total), total }
    }

    /// Reads, packs and writes the weights of a stretch. The stretch before may still run. The one before that has: its weights were
    /// given back when its end was waited for.
    async fn load(&self, calls: &'a Calls) -> Result<Loaded<'a>, GraphError> {
        let program = match self.source {
            Some(source) => {
                let go = &mut |_, _| ControlFlow::Continue(());
                let store = WeightStore::load_async(self.tensors.gpu(), source, &calls.weights, go).await?;
                self.tensors.program(&calls.recorded, &store)?
            }
            None => self.tensors.program(&calls.recorded, &WeightStore::default())?,
        };
        Ok(Loaded { program: Ready::Passing(program), pieces: &calls.pieces })
    }

    /// Waits for what is in flight; the rest is not submitted.
    ///
    /// # Errors
    /// When the device is lost.
    pub async fn stop(&mut self) -> Result<(), GraphError> {
        (self.current, self.rest) = (None, [].iter());
        Ok(self.tensors.gpu().wait_async().await?)
    }

    /// Runs to the end. After each submission `progress` is called with the operations submitted so far and those of the whole run, and
    /// may break off.
    ///
    /// # Errors
    /// As [`Run::step`], or `progress` broke off ([`GraphError::Interrupted`]).
    pub async fn finish(mut self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Result<(), GraphError> {
        while let Some(Step { done, total }) = self.step().await? {
            if progress(done, total).is_break() {
                self.stop().await?;
                return Err(GraphError::Interrupted);
            }
        }
        Ok(())
    }
}

impl Loaded<'_> {
    /// The dispatches of the next submission, and their operations.
    fn take(&mut self) -> (Range<usize>, u64) {
        let first = self.pieces.first().map_or(0, |piece| piece.dispatches.start);
        let (mut end, mut flops) = (first, 0);
        while let Some((piece, rest)) = self.pieces.split_first()
            && flops < FLOPS_PER_SUBMIT
        {
            (end, flops) = (piece.dispatches.end, flops + piece.flops);
            self.pieces = rest;
        }
        (first..end, flops)
    }
}

pub(crate) fn submit(gpu: &Gpu, program: &Program, dispatches: Range<usize>) -> wgpu::SubmissionIndex {
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
