//! Parameters that are trained become inputs: buffers of the host's that outlive a run ([`crate::Bindings`]) and that an optimiser writes.
//!
//! Matrices are then packed on the device before they are used, in whatever form their reader wants. Parameters that are not adopted stay
//! with the weights, packed once by the host. Gradients are recorded before ([`Graph::gradients`]), while a parameter is one value.

use std::collections::{BTreeMap, BTreeSet};

use omnix_kernels::WeightType;
use omnix_kernels::copy::{Copy as StridedCopy, Strided};
use rustc_hash::FxHashMap;

use crate::error::{GraphError, u32_of};
use crate::graph::{Operation as _, Packing, Parameter, Source, Value};
use crate::ops::{Graph, Node};

/// The name of the input that a tensor becomes.
#[must_use]
pub fn parameter_input(tensor: &str) -> String {
    format!("parameter.{tensor}")
}

/// The name of the output that a tensor's gradient becomes.
#[must_use]
pub fn gradient_output(tensor: &str) -> String {
    format!("gradient.{tensor}")
}

impl Graph {
    /// The tensors of the checkpoint that the graph reads, in the order of their names, each with the blocks of it that are read.
    fn tensors(&self) -> BTreeMap<String, Vec<(Parameter, Value)>> {
        let mut found: BTreeMap<String, Vec<(Parameter, Value)>> = BTreeMap::new();
        for (value, info) in self.values() {
            if let Source::Parameter(parameter) = &info.source {
                found.entry(parameter.name.to_string()).or_default().push((parameter.clone(), value));
            }
        }
        found
    }

    /// Records the gradient of `loss` for every tensor of the checkpoint that `wanted` takes, as outputs called [`gradient_output`], whole
    /// tensors in the checkpoint's order. Gives the names of those that the loss depends on, in their order.
    ///
    /// # Errors
    /// As [`Graph::differentiate`].
    pub fn gradients(&mut self, loss: Value, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<String>, GraphError> {
        let tensors: Vec<_> = self.tensors().into_iter().filter(|(name, _)| wanted(name)).collect();
        let leaves: Vec<Value> =
            tensors.iter().flat_map(|(_, blocks)| blocks.iter().map(|(_, value)| *value)).collect();
        let mut found = self.differentiate(loss, &leaves)?.into_iter();
        // A buffer of the host's holds one output: what is one already, or an input or a constant, is copied.
        let mut taken: BTreeSet<Value> = self.outputs.iter().map(|v| self.root(*v)).collect();
        let mut names = Vec::with_capacity(tensors.len());
        for (name, blocks) in tensors {
            let parts: Vec<(Parameter, Value)> = blocks
                .into_iter()
                .zip(&mut found)
                .filter_map(|((parameter, _), gradient)| Some((parameter, gradient?)))
                .collect();
            let Some((first, _)) = parts.first() else { continue };
            let full = first.full.clone();
            let whole =
                parts.iter().find(|(p, g)| p.shape() == full && self.is_made(*g) && !taken.contains(&self.root(*g)));
            let gradient = match whole {
                Some((_, gradient)) if parts.len() == 1 => *gradient,
                _ => {
                    let pieces = parts.iter().map(|(p, gradient)| Ok((*gradient, to_place(p)?)));
                    let pieces = pieces.collect::<Result<Vec<_>, GraphError>>()?;
                    self.in_zeros(full, pieces)?
                }
            };
            taken.insert(self.root(gradient));
            self.output(gradient, &gradient_output(&name));
            names.push(name);
        }
        Ok(names)
    }

    /// Whether a node makes the value's memory.
    fn is_made(&self, value: Value) -> bool {
        matches!(self.info(self.root(value)).source, Source::Node(_))
    }

    /// The same graph with the tensors of these names as inputs, called [`parameter_input`], f32. `copies`: how the copies of them are stored
    /// that products read, f32 or f16.
    ///
    /// # Errors
    /// When a tensor is read in a form that only the host makes, or copies shall be int8.
    pub fn adopt(&self, names: &[String], copies: WeightType) -> Result<Self, GraphError> {
        let mut graph = self.clone();
        graph.nodes.clear();
        let mut inputs: BTreeMap<Value, (Value, Parameter)> = BTreeMap::new();
        for (name, blocks) in self.tensors() {
            let Some((first, _)) = blocks.first().filter(|_| names.contains(&name)) else { continue };
            let whole = graph.input(&parameter_input(&name), first.full.clone());
            inputs.extend(blocks.into_iter().map(|(parameter, value)| (value, (whole, parameter))));
        }
        let mut adopted = Adopted { graph, inputs, copies, made: FxHashMap::default() };
        for node in &self.nodes {
            adopted.take(self, node)?;
        }
        Ok(adopted.graph)
    }
}

/// Where a block's gradient goes in that of the whole tensor.
fn to_place(parameter: &Parameter) -> Result<StridedCopy, GraphError> {
    let (start, row) = parameter.place();
    let shape = parameter.shape();
    let rows = shape.first().copied().unwrap_or(1);
    let width = shape.elements() / rows.max(1);
    let n = |n: usize| u32_of("copy", n);
    let dims = [1, 1, 1, 1, n(rows)?, n(width)?];
    let dst = Strided { offset: start as u64, strides: [0, 0, 0, 0, n(row)?, 1] };
    Ok(StridedCopy { shape: dims, src: Strided::contiguous(dims), dst })
}

/// A graph on its way to another, node by node.
struct Adopted {
    graph: Graph,
    /// For each value of a parameter, the input of the whole tensor and the block of it.
    inputs: BTreeMap<Value, (Value, Parameter)>,
    /// How the copies that products read are stored.
    copies: WeightType,
    /// What readers have in place of a value of a parameter, by the value they read and the form they read it in.
    made: FxHashMap<(Value, Packing), Value>,
}

impl Adopted {
    /// Takes over a node of `from`, with what it reads of adopted tensors made ready before it.
    fn take(&mut self, from: &Graph, node: &Node) -> Result<(), GraphError> {
        let mut op = node.op.clone();
        let mut ready: BTreeMap<Value, Value> = BTreeMap::new();
        for input in op.inputs() {
            if self.inputs.contains_key(&from.root(input)) && !ready.contains_key(&input) {
                let packing = node.op.packing(from, input, self.copies);
                ready.insert(input, self.ready(from, input, packing)?);
            }
        }
        op.map_inputs(&mut |value| ready.get(&value).copied().unwrap_or(value));
        let index = self.graph.nodes.len();
        for value in &node.outputs {
            self.graph.values.info_mut(*value).source = Source::Node(index);
        }
        self.graph.nodes.push(Node { op, outputs: node.outputs.clone() });
        Ok(())
    }

    /// What a reader has in place of `value`.
    fn ready(&mut self, from: &Graph, value: Value, packing: Packing) -> Result<Value, GraphError> {
        let key = (value, packing);
        if let Some(made) = self.made.get(&key) {
            return Ok(*made);
        }
        let root = from.root(value);
        let (whole, block) = self.inputs[&root].clone();
        let made = match packing {
            Packing::Matrix(form, storage) => self.graph.pack(whole, block, form, storage)?,
            Packing::Plain | Packing::Repeat(_) => {
                let is_whole = block.shape() == block.full;
                let plain = if is_whole { whole } else { self.block(whole, &block)? };
                let plain = self.graph.reshape(plain, from.shape(value).clone())?;
                match packing {
                    Packing::Repeat(count) => self.graph.repeat(plain, count)?,
                    _ => plain,
                }
            }
        };
        self.made.insert(key, made);
        Ok(made)
    }

    /// The block on its own.
    fn block(&mut self, whole: Value, block: &Parameter) -> Result<Value, GraphError> {
        let place = to_place(block)?;
        let piece = StridedCopy { src: place.dst, dst: place.src, ..place };
        self.graph.in_zeros(block.shape(), vec![(whole, piece)])
    }
}
