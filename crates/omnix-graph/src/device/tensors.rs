//! The values of a plan on a device: buffers of intermediates, inputs, outputs and constants.

use omnix_kernels::dispatch::round_up;
use omnix_kernels::{BufferSlice, Gpu, Program, readback};
use rustc_hash::FxHashMap;

use super::store::WeightStore;
use crate::error::GraphError;
use crate::graph::{Source, Value};
use crate::plan::Plan;
use crate::plan::memory::Place;
use crate::plan::record::{Recorded, Slot, Stored};

/// Buffers the host owns, for inputs and outputs by name; what is not named here is allocated.
pub type Bindings = FxHashMap<String, BufferSlice>;

/// What every tensor's buffer can be used for.
const USAGE: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::UNIFORM)
    .union(wgpu::BufferUsages::COPY_SRC)
    .union(wgpu::BufferUsages::COPY_DST);

/// A plan and the buffers of everything but its weights.
#[derive(Debug)]
pub struct Tensors {
    gpu: Gpu,
    plan: Plan,
    /// Buffer of each value's root, where it has one.
    buffers: Vec<Option<BufferSlice>>,
}

impl Tensors {
    /// Allocates the plan's buffers.
    pub(crate) fn new(gpu: &Gpu, plan: Plan, bindings: &Bindings) -> Result<Self, GraphError> {
        let buffers = allocate(gpu, &plan, bindings)?;
        Ok(Self { gpu: gpu.clone(), plan, buffers })
    }

    /// Makes kernel calls ready that read `weights`.
    pub(crate) fn program(&self, calls: &[Recorded], weights: &WeightStore) -> Result<Program, GraphError> {
        let mut args: Vec<Vec<BufferSlice>> = Vec::with_capacity(calls.len());
        for call in calls {
            let resolve = |slot: &Slot| {
                let whole = match slot.value {
                    Stored::Value(v) => self.buffers[v.0 as usize].as_ref(),
                    Stored::Weight(i) => weights.get(&self.plan.weights[i]),
                };
                whole.map(|w| BufferSlice {
                    offset: w.offset + slot.offset,
                    size: slot.size.min(w.size),
                    buffer: w.buffer.clone(),
                })
            };
            let found: Option<Vec<_>> = call.args.iter().map(resolve).collect();
            args.push(found.ok_or_else(|| GraphError::NoSuchValue { name: call.name.clone() })?);
        }
        let pairs =
            calls.iter().zip(&args).flat_map(|(call, args)| call.dispatches.iter().map(move |d| (d, args.as_slice())));
        Ok(Program::new(&self.gpu, pairs)?)
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
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
        self.write_all(name, data)
    }

    /// Writes all of an input of indices.
    ///
    /// # Errors
    /// When the name or the length is wrong.
    pub fn write_indices(&self, name: &str, data: &[u32]) -> Result<(), GraphError> {
        self.write_all(name, data)
    }

    fn write_all<T: bytemuck::Pod>(&self, name: &str, data: &[T]) -> Result<(), GraphError> {
        let slice = self.slice(name)?;
        let expected = slice.size as usize / 4;
        if data.len() != expected {
            return Err(GraphError::InputLength { name: name.to_owned(), expected, got: data.len() });
        }
        self.gpu.queue.write_buffer(&slice.buffer, slice.offset, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Writes numbers of an input from element `start` on, such as one image of many.
    ///
    /// # Errors
    /// When the name is wrong or the numbers do not fit.
    pub fn write_at(&self, name: &str, start: usize, data: &[f32]) -> Result<(), GraphError> {
        let slice = self.slice(name)?;
        let expected = slice.size as usize / 4;
        if start.checked_add(data.len()).is_none_or(|end| end > expected) {
            return Err(GraphError::InputLength {
                name: name.to_owned(),
                expected,
                got: start.saturating_add(data.len()),
            });
        }
        self.gpu.queue.write_buffer(&slice.buffer, slice.offset + start as u64 * 4, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Reads an output (waits for everything submitted).
    ///
    /// # Errors
    /// When the name is wrong or the device is lost.
    pub async fn read_async(&self, name: &str) -> Result<Vec<f32>, GraphError> {
        Ok(readback::read_async(&self.gpu, &self.slice(name)?).await?)
    }
}

/// Blocking.
#[cfg(not(target_arch = "wasm32"))]
impl Tensors {
    /// As [`Tensors::read_async`].
    ///
    /// # Errors
    /// As there.
    pub fn read(&self, name: &str) -> Result<Vec<f32>, GraphError> {
        Ok(readback::read(&self.gpu, &self.slice(name)?)?)
    }

    /// Reads an output of indices.
    ///
    /// # Errors
    /// When the name is wrong or the device is lost.
    pub fn read_indices(&self, name: &str) -> Result<Vec<u32>, GraphError> {
        Ok(readback::read(&self.gpu, &self.slice(name)?)?)
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
