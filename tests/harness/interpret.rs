//! Runs a graph on the processor in f64, node by node: what is recorded, computed from the operations' definitions.
//!
//! Shares nothing with the kernels but the hash of dropout. It shows that what is recorded is the network and that fusion keeps it, and
//! it is the function whose central differences gradients are compared with. Plain loops over row-major numbers; heads are
//! `[group, head, token, channel]` whatever layout the kernels use. A u32 is kept as the number whose f32 has its bits: exact for indices,
//! whose f32 are finite. A straight-through value has the numbers of its value.
//!
//! A run may be near another ([`Run::near`]): then it says what gradients of straight-through values mean. They change with what stands
//! for them, if anything does, a hard gate changes with its score, and what was chosen stays chosen.
//!
//! Scratch results of a node are left out, and so are gradients: what a pass records for them is what is under test.

mod block;
mod heads;
mod map;
mod motion;
mod moves;
mod pointwise;
mod product;
mod rows;

use std::collections::BTreeMap;

use omnix_graph::graph::Source;
use omnix_graph::ops::Op;
use omnix_graph::{Graph, Operation as _, Value};

/// The numbers of a graph's values.
#[derive(Debug)]
pub struct Run<'a> {
    graph: &'a Graph,
    /// By the value that has the memory; straight-through values that are near another run's have numbers of their own.
    values: BTreeMap<Value, Vec<f64>>,
    /// The run that this one is near.
    base: Option<&'a Self>,
}

/// Runs `graph` with these inputs; `parameter` gives a tensor of the checkpoint.
///
/// # Panics
/// When an input is missing or has another length, or an operation is one that only gradients and optimisers record.
pub fn run<'a>(graph: &'a Graph, inputs: &[(&str, &[f32])], parameter: &dyn Fn(&str) -> Vec<f32>) -> Run<'a> {
    let input = |name: &str| {
        let found = inputs.iter().find(|(given, _)| *given == name);
        wide(found.unwrap_or_else(|| panic!("no input {name}")).1)
    };
    run_f64(graph, &input, &|name| wide(&parameter(name)))
}

/// As [`run`], with the numbers of each input and parameter in f64.
///
/// # Panics
/// As there.
pub fn run_f64<'a>(
    graph: &'a Graph,
    input: &dyn Fn(&str) -> Vec<f64>,
    parameter: &dyn Fn(&str) -> Vec<f64>,
) -> Run<'a> {
    Run { graph, values: BTreeMap::new(), base: None }.through(input, parameter)
}

impl Run<'_> {
    /// A run of the same graph with numbers close to this one's, for differences that stand for derivatives.
    ///
    /// # Panics
    /// As [`run`].
    #[must_use]
    pub fn near(&self, input: &dyn Fn(&str) -> Vec<f64>, parameter: &dyn Fn(&str) -> Vec<f64>) -> Run<'_> {
        Run { graph: self.graph, values: BTreeMap::new(), base: Some(self) }.through(input, parameter)
    }

    /// Reads what is given and computes the nodes.
    fn through(mut self, input: &dyn Fn(&str) -> Vec<f64>, parameter: &dyn Fn(&str) -> Vec<f64>) -> Self {
        let graph = self.graph;
        for (value, info) in graph.values() {
            let data = match &info.source {
                Source::Input => input(&info.name),
                Source::Constant(data) => wide(data),
                Source::Parameter(p) => {
                    let all = parameter(&p.name);
                    assert_eq!(all.len(), p.full.elements(), "{}", p.name);
                    block::block(p, &all)
                }
                Source::Node(_) | Source::Reshape(_) | Source::StraightThrough { .. } => continue,
            };
            assert_eq!(data.len(), info.shape.elements(), "{}", info.name);
            self.values.insert(value, data);
        }
        for node in graph.nodes() {
            node.op.inputs().into_iter().for_each(|value| self.stand_in(value));
            let results = self.node(&node.op, &node.outputs);
            for (value, data) in node.outputs.iter().zip(results) {
                assert_eq!(data.len(), graph.shape(*value).elements(), "{}", graph.value_name(*value));
                self.values.insert(*value, data);
            }
        }
        self
    }

    /// Gives the straight-through values behind `value` the numbers of the other run's, changed by what stands for them.
    fn stand_in(&mut self, value: Value) {
        let Some(base) = self.base else { return };
        match self.graph.info(value).source {
            Source::Reshape(x) => self.stand_in(x),
            Source::StraightThrough { gradient, .. } if !self.values.contains_key(&value) => {
                let mut data = base.get(value).to_vec();
                if let Some(gradient) = gradient {
                    self.stand_in(gradient);
                    let moved = self.get(gradient).iter().zip(base.get(gradient)).map(|(now, then)| now - then);
                    data.iter_mut().zip(moved).for_each(|(v, d)| *v += d);
                }
                self.values.insert(value, data);
            }
            _ => {}
        }
    }
}

impl Run<'_> {
    /// The numbers of `value`.
    ///
    /// # Panics
    /// When it has not been computed.
    #[must_use]
    pub fn get(&self, value: Value) -> &[f64] {
        let mut at = value;
        loop {
            match (self.values.get(&at), &self.graph.info(at).source) {
                (Some(found), _) => return found,
                (None, Source::Reshape(inner) | Source::StraightThrough { value: inner, .. }) => at = *inner,
                (None, _) => panic!("{} is not computed", self.graph.value_name(at)),
            }
        }
    }

    /// The numbers of `value` as a device has them.
    ///
    /// # Panics
    /// When it has not been computed.
    #[must_use]
    pub fn rounded(&self, value: Value) -> Vec<f32> {
        self.get(value).iter().map(|v| *v as f32).collect()
    }

    /// The numbers of the value of this name, if it has been computed.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<Vec<f32>> {
        let value = self.graph.find(name)?;
        self.values.contains_key(&self.graph.root(value)).then(|| self.rounded(value))
    }

    fn dims(&self, value: Value) -> Vec<usize> {
        self.graph.shape(value).to_vec()
    }

    fn width(&self, value: Value) -> usize {
        self.graph.shape(value).width()
    }

    /// The indices that `value` holds.
    fn indices(&self, value: Value) -> Vec<usize> {
        self.get(value).iter().map(|v| index(*v)).collect()
    }

    /// The results of a node.
    fn node(&self, op: &Op, outputs: &[Value]) -> Vec<Vec<f64>> {
        let y = outputs[0];
        let one = match op {
            Op::Linear(op) => self.linear(op),
            Op::Conv2d(op) => self.conv2d(op),
            Op::Pack(op) => block::block(&op.block, self.get(op.x)),
            Op::LayerNorm(op) => self.layer_norm(op),
            Op::SplitHeads(op) => self.split_heads(op),
            Op::Attention(op) => self.attention(op),
            Op::Resize(op) => self.resize(op, y),
            Op::Copies(op) => self.copies(op, y),
            Op::Fill(op) => vec![f64::from(f32::from_bits(op.value)); self.graph.shape(y).elements()],
            Op::Gather(op) => self.gather(op),
            Op::Scatter(op) => self.scatter(op),
            Op::Map(op) => self.map(op),
            Op::Zip(op) => self.zip(op),
            Op::Select(op) => self.select(op),
            Op::SwiGlu(op) => self.swiglu(op),
            Op::Dropout(op) => self.dropout(op),
            Op::Softmax(op) => self.softmax(op),
            Op::Reduce(op) => self.reduce(op),
            Op::Rank(op) => self.rank(op),
            Op::TopK(_) | Op::ReferenceView(_) if self.base.is_some() => return self.as_before(outputs),
            Op::TopK(op) => return self.top_k(op),
            Op::ReferenceView(op) => return self.reference_view(op),
            Op::TokenExpand(op) => self.token_expand(op),
            Op::FieldScatter(op) => self.field_scatter(op, y),
            Op::DeformSample(op) => self.deform_sample(&op.0),
            Op::TrajApply(op) => return self.traj_apply(op),
            Op::Trajectory(op) => return self.trajectory(op),
            other => panic!("{} is not interpreted", other.name()),
        };
        vec![one]
    }
}

impl Run<'_> {
    /// The numbers of values in the run that this one is near.
    fn as_before(&self, values: &[Value]) -> Vec<Vec<f64>> {
        self.base.map(|base| values.iter().map(|v| base.get(*v).to_vec()).collect()).unwrap_or_default()
    }
}

/// Numbers of a device in f64.
#[must_use]
pub fn wide(data: &[f32]) -> Vec<f64> {
    data.iter().map(|v| f64::from(*v)).collect()
}

/// The index that is kept as this number.
fn index(kept: f64) -> usize {
    (kept as f32).to_bits() as usize
}

/// An index as it is kept.
fn kept(index: usize) -> f64 {
    f64::from(f32::from_bits(u32::try_from(index).unwrap_or_else(|_| panic!("index {index}"))))
}
