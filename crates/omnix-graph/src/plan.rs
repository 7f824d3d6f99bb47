//! A plan: fused graph, chains, chunk sizes, buffers. Everything is known here before a device is touched.

use omnix_kernels::winograd::PLACES;
use omnix_kernels::{Caps, Dispatch, PackedWeights, WeightType};

use crate::algorithm;
use crate::error::GraphError;
use crate::fixed;
use crate::fuse::fuse;
use crate::graph::{Graph, Node, Source, Value};
use crate::memory::{MemoryPlan, Place, assign};
use crate::op::{Op, WeightForm};
use crate::record::record;
use crate::schedule::{Segment, segments};
use crate::stream::passing_bytes;
use crate::weights::{Packing, WeightKey};

/// What the caller decides.
#[derive(Clone, Copy, Debug)]
pub struct PlanOptions {
    /// Bytes that everything but weights that stay may take; `None` for no bound.
    pub budget: Option<u64>,
    /// Whether weights pass through ([`crate::Streamed`]): then the budget is for them too.
    pub streamed: bool,
    /// How matrices are stored.
    pub storage: WeightType,
    /// Whether to fuse; off only in tests that compare.
    pub fuse: bool,
    /// Chains go in at least so many parts; 1 unless a test wants chunks.
    pub parts: usize,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { budget: None, streamed: false, storage: WeightType::F32, fuse: true, parts: 1 }
    }
}

/// A graph made ready for one kind of device: made once for a shape, run many times.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The fused graph.
    pub graph: Graph,
    /// So many nodes at the front depend on parameters and constants alone; they are no part of a run. 0 where weights pass through.
    pub fixed: usize,
    /// Its nodes in chains.
    pub segments: Vec<Segment>,
    /// Chains go in about so many parts.
    pub parts: usize,
    /// Buffers.
    pub memory: MemoryPlan,
    /// The device's facts.
    pub caps: Caps,
    /// Whether weights pass through ([`crate::Streamed`]).
    pub streamed: bool,
    /// How matrices are stored.
    pub storage: WeightType,
    /// The parameters in the form they are stored, in order of first use.
    pub weights: Vec<WeightKey>,
}

/// More parts than this gain nothing: chains are down to single images long before.
const MAX_PARTS: usize = 1 << 14;

impl Plan {
    /// Plans `graph` for a device with `caps`.
    ///
    /// # Errors
    /// [`GraphError::Budget`] with the least that works, or [`GraphError::TensorTooLarge`].
    pub fn new(graph: &Graph, caps: &Caps, options: &PlanOptions) -> Result<Self, GraphError> {
        let mut graph = if options.fuse { fuse(graph) } else { graph.clone() };
        algorithm::choose(&mut graph, caps, options.storage);
        let fixed = if options.streamed { 0 } else { fixed::to_front(&mut graph) };
        let Fit { segments, parts, memory, .. } = fit(&graph, fixed, caps, options)?;
        let weights = weights(&graph, options.storage);
        // Operands are as good as the weights.
        let caps = caps.clone().with_f16(caps.f16 && options.storage != WeightType::F32);
        let PlanOptions { streamed, storage, .. } = *options;
        Ok(Self { graph, fixed, segments, parts, memory, caps, streamed, storage, weights })
    }

    /// Bytes of the weights.
    #[must_use]
    pub fn weight_bytes(&self) -> u64 {
        self.weights.iter().map(WeightKey::bytes).sum()
    }

    /// Bytes of weights on the device while the plan runs: all, or where they pass through those of two stretches. On devices that
    /// weights are copied to, the copy's source is not counted.
    #[must_use]
    pub fn resident_weight_bytes(&self) -> u64 {
        if self.streamed {
            passing_bytes(&self.graph, &self.segments, self.parts, self.storage, &self.caps)
        } else {
            self.weight_bytes()
        }
    }

    /// Bytes of everything but the weights while the plan runs.
    #[must_use]
    pub fn working_bytes(&self) -> u64 {
        self.memory.total()
    }

    /// Floating-point operations of a run (a multiply-add is two).
    #[must_use]
    pub fn flops(&self) -> u64 {
        (self.fixed..self.graph.nodes.len()).map(|i| node_flops(&self.graph, i)).sum()
    }

    /// Rows of the largest chunk of each chain, for reports: `(first node's name, rows, rows of a chunk)`.
    #[must_use]
    pub fn chunks(&self) -> Vec<(String, usize, usize)> {
        let chains = self.segments.iter().filter_map(|s| Some((s, s.chain.as_ref()?)));
        chains
            .map(|(s, chain)| {
                let first = &self.graph.nodes[s.nodes.start];
                (self.graph.value_name(first.outputs[0]).to_owned(), chain.rows, chain.chunk_rows(self.parts))
            })
            .collect()
    }

    /// One dispatch of each kernel variant this plan needs, in the order of their first use.
    ///
    /// # Errors
    /// As a run would.
    pub fn kernels(&self) -> Result<Vec<Dispatch>, GraphError> {
        let mut seen = rustc_hash::FxHashSet::default();
        let recorded = record(self)?.into_iter().flat_map(|call| call.dispatches);
        Ok(recorded.filter(|d| seen.insert((d.shader.kernel, d.shader.variant))).collect())
    }

    /// Where `value` lives.
    #[must_use]
    pub fn place(&self, value: Value) -> Place {
        self.memory.places[self.graph.root(value).0 as usize]
    }
}

/// Chains, the parts they go in, and the memory that takes.
struct Fit {
    segments: Vec<Segment>,
    parts: usize,
    memory: MemoryPlan,
    /// Bytes that the budget is for.
    bytes: u64,
}

/// The fewest parts whose memory fits the budget and the device's largest buffer. Where weights pass through, short chains need few
/// weights at once and long ones have less between them: whichever does with fewer parts.
fn fit(graph: &Graph, fixed: usize, caps: &Caps, options: &PlanOptions) -> Result<Fit, GraphError> {
    let with = |short| fit_parts(graph, segments(graph, fixed, caps.align, short), fixed, caps, options);
    let long = with(false);
    if !options.streamed || long.as_ref().is_ok_and(|fit| fit.parts == 1) {
        return long;
    }
    match (long, with(true)) {
        (Ok(long), Ok(short)) if (short.parts, short.bytes) < (long.parts, long.bytes) => Ok(short),
        (Err(GraphError::Budget { least: a, budget }), Err(GraphError::Budget { least: b, .. })) => {
            Err(GraphError::Budget { budget, least: a.min(b) })
        }
        (Err(_), short) => short,
        (long, _) => long,
    }
}

fn fit_parts(
    graph: &Graph,
    segments: Vec<Segment>,
    fixed: usize,
    caps: &Caps,
    options: &PlanOptions,
) -> Result<Fit, GraphError> {
    let budget = options.budget.unwrap_or(u64::MAX);
    let weights =
        |parts| if options.streamed { passing_bytes(graph, &segments, parts, options.storage, caps) } else { 0 };
    // Depends on whether chains go in chunks, not on how many.
    let passing = [weights(1), weights(2)];
    let mut parts = options.parts.max(1);
    let mut least = u64::MAX;
    loop {
        let tried = assign(graph, &segments, fixed, parts, caps.max_buffer);
        let smallest = |s: &Segment| s.chain.as_ref().is_none_or(|c| c.chunk_rows(parts) <= c.unit);
        let last = parts >= MAX_PARTS || segments.iter().all(smallest);
        match tried {
            Ok(memory) => {
                let bytes = memory.total() + passing[usize::from(parts > 1)];
                if bytes <= budget {
                    return Ok(Fit { segments, parts, memory, bytes });
                }
                least = least.min(bytes);
            }
            Err(error) if last => return Err(error),
            Err(_) => {}
        }
        if last {
            return Err(GraphError::Budget { budget, least });
        }
        parts *= 2;
    }
}

/// The form in which each parameter is read, in order of first use.
fn weights(graph: &Graph, storage: WeightType) -> Vec<WeightKey> {
    let mut seen = rustc_hash::FxHashSet::default();
    let mut keys = Vec::new();
    for node in &graph.nodes {
        for key in weights_read(graph, node, storage) {
            if seen.insert(key.clone()) {
                keys.push(key);
            }
        }
    }
    keys
}

/// The weights that `node` reads.
pub(crate) fn weights_read(graph: &Graph, node: &Node, storage: WeightType) -> impl Iterator<Item = WeightKey> {
    node.op.inputs().into_iter().filter_map(move |value| weight_key(graph, node, value, storage))
}

/// A transposed convolution's bias is repeated for every pixel of a block.
fn bias_packing(node: &Node, value: Value) -> Packing {
    match &node.op {
        Op::Linear(l) if l.form == WeightForm::ConvTranspose && l.bias == Some(value) => Packing::Repeat,
        _ => Packing::Plain,
    }
}

/// The key under which `value`, read by `node`, is stored.
pub(crate) fn weight_key(graph: &Graph, node: &Node, value: Value, storage: WeightType) -> Option<WeightKey> {
    let Source::Parameter(parameter) = &graph.info(graph.root(value)).source else { return None };
    let matrix = |form| Packing::Matrix(form, stored_as(graph, value, storage));
    let packing = match &node.op {
        Op::Linear(l) if l.w == value => matrix(l.form),
        Op::Conv2d(c) if c.w == value => matrix(c.form),
        _ => bias_packing(node, value),
    };
    Some(WeightKey { parameter: parameter.clone(), packing })
}

/// How the matrix `value` is stored when the plan stores matrices as `storage`. int8 is for linear layers: the kernels of
/// convolutions, four axes long, are f16 then.
pub(crate) fn stored_as(graph: &Graph, value: Value, storage: WeightType) -> WeightType {
    match &graph.info(graph.root(value)).source {
        Source::Parameter(p) if p.keep_f32 => WeightType::F32,
        _ if storage == WeightType::I8 && graph.shape(value).len() != 2 => WeightType::F16,
        _ => storage,
    }
}

/// Floating-point operations of node `index`; what only moves numbers counts none.
#[must_use]
pub fn node_flops(graph: &Graph, index: usize) -> u64 {
    let node = &graph.nodes[index];
    let elements = |v: Value| graph.shape(v).elements() as u64;
    let out = node.outputs[0];
    match &node.op {
        Op::Linear(l) => 2 * elements(out) * graph.shape(l.x).width() as u64,
        Op::Conv2d(c) => {
            let taps: usize = graph.shape(c.w)[1..].iter().product();
            2 * elements(out) * taps as u64
        }
        Op::Attention(a) => 4 * (a.groups * a.queries * a.keys * a.heads * a.head_dim) as u64,
        Op::LayerNorm { .. } | Op::Softmax { .. } => 6 * elements(out),
        Op::Resize { .. } => 8 * elements(out),
        Op::SplitHeads(_) | Op::SwiGlu { .. } => 4 * elements(out),
        Op::Reduce { x, .. } | Op::TopK { x, .. } | Op::ReferenceView { x, .. } => elements(*x),
        Op::Unary { .. } | Op::Binary { .. } => elements(out),
        Op::TokenExpand { .. } => 4 * elements(out),
        // Four cells of nine channels a point, weight and time; rotating and moving a point, about 90.
        Op::DeformSample(s) => 8 * elements(s.weights) * graph.shape(out).width() as u64,
        Op::TrajApply { .. } => 30 * elements(out),
        Op::Trajectory(t) => 8 * elements(t.sampling.weights) * (9 * (t.times as u64 + 1) + 1) + 30 * elements(out),
        Op::FieldScatter { .. } | Op::Copy { .. } | Op::Gather { .. } | Op::Scatter { .. } => 0,
    }
}

/// The packed shape of the matrix of a linear layer or convolution, from the parameter's shape.
#[must_use]
pub fn packed_shape(shape: &[usize], form: WeightForm, storage: WeightType) -> PackedWeights {
    let product = |dims: &[usize]| dims.iter().product::<usize>() as u32;
    let (k, n) = match form {
        WeightForm::Linear | WeightForm::Conv => (product(&shape[1..]), shape[0] as u32),
        WeightForm::Winograd => (PLACES * shape[1] as u32, shape[0] as u32),
        WeightForm::ConvTranspose => (shape[0] as u32, product(&shape[1..])),
    };
    PackedWeights { k, n, storage }
}
