//! A plan on a device: buffers, bind groups, and the encoding of a run.

use std::ops::{ControlFlow, Range};

use omnix_kernels::dispatch::round_up;
use omnix_kernels::{BufferSlice, Dispatch, Gpu, Program, run};
use rustc_hash::FxHashMap;

use crate::error::GraphError;
use crate::graph::{Source, Value};
use crate::memory::Place;
use crate::plan::{Plan, node_flops};
use crate::record::{Recorded, Slot, record};
use crate::weights::WeightStore;

/// A plan with its memory on a device; run it as often as you like.
#[derive(Debug)]
pub struct Executable {
    gpu: Gpu,
    plan: Plan,
    program: Program,
    /// Buffer of each value's root, where it has one.
    buffers: Vec<Option<BufferSlice>>,
    /// The kernel calls in order.
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

/// Buffers the host owns, for inputs and outputs by name; what is not named here is allocated.
pub type Bindings = FxHashMap<String, BufferSlice>;

/// About as many operations go into one submission: half a second on a slow software device.
const FLOPS_PER_SUBMIT: u64 = 10_000_000_000;

/// What every tensor's buffer can be used for.
const USAGE: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::UNIFORM)
    .union(wgpu::BufferUsages::COPY_SRC)
    .union(wgpu::BufferUsages::COPY_DST);

impl Executable {
    /// Allocates the plan's buffers and makes its pipelines and bind groups.
    ///
    /// # Errors
    /// When memory runs out, a pipeline cannot be made, or a host buffer in `bindings` is too small.
    pub fn new(gpu: &Gpu, plan: Plan, weights: &WeightStore, bindings: &Bindings) -> Result<Self, GraphError> {
        let recorded = record(&plan)?;
        let buffers = allocate(gpu, &plan, bindings)?;
        let stored = |i: usize| weights.get(&plan.weights[i]).cloned();
        let mut args: Vec<Vec<BufferSlice>> = Vec::with_capacity(recorded.len());
        for call in &recorded {
            let resolve = |slot: &Slot| {
                let whole = match slot.value {
                    crate::record::Stored::Value(v) => buffers[v.0 as usize].clone(),
                    crate::record::Stored::Weight(i) => stored(i),
                };
                whole.map(|w| BufferSlice {
                    offset: w.offset + slot.offset,
                    size: slot.size.min(w.size),
                    buffer: w.buffer,
                })
            };
            let found: Option<Vec<_>> = call.args.iter().map(resolve).collect();
            args.push(found.ok_or_else(|| GraphError::NoSuchValue { name: call.name.clone() })?);
        }
        let pairs: Vec<(&Dispatch, &[BufferSlice])> = recorded
            .iter()
            .zip(&args)
            .flat_map(|(call, args)| call.dispatches.iter().map(move |d| (d, args.as_slice())))
            .collect();
        let program = Program::new(gpu, pairs)?;
        let pieces = pieces(&plan, &recorded);
        Ok(Self { gpu: gpu.clone(), plan, program, buffers, pieces })
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Number of dispatches of a run.
    #[must_use]
    pub fn dispatches(&self) -> usize {
        self.program.len()
    }

    /// The buffer of an input or output: results stay on the device for whoever wants them.
    ///
    /// # Errors
    /// When the graph has no such value, or it did not stay.
    pub fn slice(&self, name: &str) -> Result<BufferSlice, GraphError> {
        let missing = || GraphError::NoSuchValue { name: name.to_owned() };
        let value = self.find(name).ok_or_else(missing)?;
        let slice = self.buffers[self.plan.graph.root(value).0 as usize].clone().ok_or_else(missing)?;
        Ok(BufferSlice { size: self.plan.graph.shape(value).bytes(), ..slice })
    }

    /// The input or output called `name`.
    fn find(&self, name: &str) -> Option<Value> {
        let graph = &self.plan.graph;
        let output = graph.outputs().iter().find(|v| graph.value_name(**v) == name).copied();
        output.or_else(|| {
            graph.values().find(|(_, i)| i.name == name && matches!(i.source, Source::Input)).map(|(v, _)| v)
        })
    }

    /// Writes all numbers of an input.
    ///
    /// # Errors
    /// When the name or the length is wrong.
    pub fn write(&self, name: &str, data: &[f32]) -> Result<(), GraphError> {
        let slice = self.slice(name)?;
        let expected = slice.size as usize / 4;
        if data.len() != expected {
            return Err(GraphError::InputLength { name: name.to_owned(), expected, got: data.len() });
        }
        self.write_at(name, 0, data)
    }

    /// Writes numbers of an input from element `start` on, such as one image of many.
    ///
    /// # Errors
    /// When the name is wrong or the numbers do not fit.
    pub fn write_at(&self, name: &str, start: usize, data: &[f32]) -> Result<(), GraphError> {
        let slice = self.slice(name)?;
        let expected = slice.size as usize / 4;
        if start + data.len() > expected {
            return Err(GraphError::InputLength { name: name.to_owned(), expected, got: start + data.len() });
        }
        self.gpu.queue.write_buffer(&slice.buffer, slice.offset + start as u64 * 4, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Reads an output (waits for everything submitted).
    ///
    /// # Errors
    /// When the name is wrong or the device is lost.
    pub fn read(&self, name: &str) -> Result<Vec<f32>, GraphError> {
        Ok(run::read(&self.gpu, &self.slice(name)?)?)
    }

    /// Reads an output of indices.
    ///
    /// # Errors
    /// When the name is wrong or the device is lost.
    pub fn read_indices(&self, name: &str) -> Result<Vec<u32>, GraphError> {
        Ok(run::read(&self.gpu, &self.slice(name)?)?)
    }

    /// Records a whole run into the host's encoder.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("omnix"), timestamp_writes: None });
        self.program.encode(&mut pass, 0..self.program.len());
    }

    /// Runs in submissions of moderate length and waits. After each, `progress` hears the operations submitted so far and all of
    /// the run, and may break off; the device then has work, so what the host does there costs no time of its own.
    ///
    /// # Errors
    /// When the device is lost or `progress` broke off ([`GraphError::Interrupted`]).
    pub fn run(&self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Result<(), GraphError> {
        let total = self.plan.flops();
        let mut done = 0;
        let mut previous: Option<wgpu::SubmissionIndex> = None;
        let mut batch = 0..0;
        let mut flops = 0u64;
        for (i, piece) in self.pieces.iter().enumerate() {
            batch.end = piece.dispatches.end;
            flops += piece.flops;
            if flops < FLOPS_PER_SUBMIT && i + 1 < self.pieces.len() {
                continue;
            }
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                self.program.encode(&mut pass, batch.clone());
            }
            let submitted = self.gpu.queue.submit([encoder.finish()]);
            // One submission stays in flight while the next is recorded.
            if let Some(index) = previous.replace(submitted) {
                self.gpu.wait_for(index)?;
            }
            done += flops;
            if progress(done.min(total), total).is_break() {
                self.gpu.wait()?;
                return Err(GraphError::Interrupted);
            }
            batch.start = batch.end;
            flops = 0;
        }
        Ok(self.gpu.wait()?)
    }

    /// The device it runs on.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

/// Buffers of the arena, of inputs and outputs, and of constants.
fn allocate(gpu: &Gpu, plan: &Plan, bindings: &Bindings) -> Result<Vec<Option<BufferSlice>>, GraphError> {
    let intermediate = |bytes: &u64| Ok(gpu.buffer("intermediates", *bytes, USAGE)?.into());
    let arena: Vec<BufferSlice> = plan.memory.arena.iter().map(intermediate).collect::<Result<_, GraphError>>()?;
    let mut buffers = vec![None; plan.memory.places.len()];
    for (value, info) in plan.graph.values() {
        let root = value.0 as usize;
        let bytes = plan.memory.bytes[root];
        buffers[root] = match plan.memory.places[root] {
            Place::Arena(i) => Some(BufferSlice { size: bytes, ..arena[i].clone() }),
            Place::Own => Some(own(gpu, plan, value, bytes, bindings)?),
            Place::Constant => {
                let buffer = gpu.buffer(&info.name, bytes, USAGE)?;
                if let Source::Constant(data) = &info.source {
                    gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(data));
                }
                Some(buffer.into())
            }
            Place::Weight | Place::Unused => None,
        };
    }
    Ok(buffers)
}

/// An input's or output's buffer: the host's if it gave one. An output may be a reshape of the stored root.
fn own(gpu: &Gpu, plan: &Plan, root: Value, bytes: u64, bindings: &Bindings) -> Result<BufferSlice, GraphError> {
    let graph = &plan.graph;
    let names = graph.values().filter(|(v, _)| graph.root(*v) == root).map(|(_, i)| &i.name);
    match names.filter_map(|name| Some((name, bindings.get(name)?))).next() {
        Some((_, slice)) if slice.size >= graph.info(root).physical.bytes() => Ok(slice.clone()),
        Some((name, slice)) => {
            let expected = (graph.info(root).physical.bytes() / 4) as usize;
            Err(GraphError::InputLength { name: name.clone(), expected, got: (slice.size / 4) as usize })
        }
        None => Ok(gpu.buffer(&graph.info(root).name, round_up(bytes, 4), USAGE)?.into()),
    }
}

fn pieces(plan: &Plan, recorded: &[Recorded]) -> Vec<Piece> {
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
