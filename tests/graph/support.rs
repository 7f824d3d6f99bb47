//! Small graphs with seeded parameters.

use std::borrow::Cow;
use std::ops::ControlFlow;

use omnix_graph::{Bindings, Executable, Graph, ParameterSource, Plan, PlanOptions, Tensors, Value, WeightStore};
use omnix_kernels::Gpu;
use omnix_tests::Rng;

/// Every parameter is seeded by its name; the scale keeps sums near one.
pub(crate) struct Seeded<'a>(pub(crate) &'a Graph);

impl ParameterSource for Seeded<'_> {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        let value = self.0.find(name).ok_or_else(|| format!("no parameter {name}"))?;
        let shape = match &self.0.info(value).source {
            omnix_graph::graph::Source::Parameter(p) => p.full.clone(),
            _ => return Err(format!("{name} is no parameter").into()),
        };
        let depth = shape.get(1..).map_or(1, |d| d.iter().product::<usize>().max(1));
        Ok(numbers(name, shape.elements()).iter().map(|v| v / (depth as f32).sqrt()).collect())
    }
}

/// Numbers seeded by `name`.
pub(crate) fn numbers(name: &str, count: usize) -> Vec<f32> {
    let seed = name.bytes().fold(7u64, |s, b| s.wrapping_mul(31).wrapping_add(u64::from(b)));
    Rng::new(seed).normal(count)
}

/// Plans and prepares `graph`.
pub(crate) fn prepare(gpu: &Gpu, graph: &Graph, options: &PlanOptions) -> Executable {
    let plan = Plan::new(graph, &gpu.caps, options).expect("plans");
    let store =
        WeightStore::load(gpu, &Seeded(graph), &plan.weights, &mut |_, _| ControlFlow::Continue(())).expect("loads");
    Executable::new(gpu, plan, &store, &Bindings::default()).expect("prepares")
}

/// Runs `graph` on seeded inputs and reads the output `y`.
pub(crate) fn run(gpu: &Gpu, graph: &Graph, options: &PlanOptions) -> Vec<f32> {
    let executable = prepare(gpu, graph, options);
    feed(&executable, graph);
    executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
    executable.read("y").expect("reads")
}

/// Seeds every input by its name.
pub(crate) fn feed(executable: &Tensors, graph: &Graph) {
    for (_, info) in graph.values() {
        if matches!(info.source, omnix_graph::graph::Source::Input) {
            executable.write(&info.name, &numbers(&info.name, info.shape.elements())).expect("writes");
        }
    }
}

/// A transformer block over `groups` sequences of `tokens` tokens, as the networks record it.
pub(crate) fn block(g: &mut Graph, x: Value, groups: usize, (heads, head_dim): (usize, usize), name: &str) -> Value {
    use omnix_graph::ops::Heads;
    use omnix_graph::ops::{Binary, Unary};
    let c = heads * head_dim;
    let vector = |g: &mut Graph, leaf: &str, n: usize| g.parameter(&format!("{name}.{leaf}"), [n]);
    let (w1, b1) = (vector(g, "norm1.weight", c), vector(g, "norm1.bias", c));
    let xn = g.layer_norm(x, Some(w1), Some(b1), 1e-6).expect("norm");
    let spec = Heads { groups, heads, head_dim, norm: None, rope: None };
    let full = [3 * c, c];
    let qkv = format!("{name}.qkv.weight");
    let kv_w = g.parameter_rows(&qkv, full, c..3 * c);
    let kv = g.linear(xn, kv_w, None).expect("kv");
    let k = g.key_heads(kv, 0, &spec).expect("k");
    let v = g.value_heads(kv, c, &spec).expect("v");
    let q_w = g.parameter_rows(&qkv, full, 0..c);
    let q = g.linear(xn, q_w, None).expect("q");
    let q = g.query_heads(q, 0, &spec).expect("q heads");
    let o = g.attention(q, k, v).expect("attention");
    let (proj, bias, gamma) =
        (g.parameter(&format!("{name}.proj"), [c, c]), vector(g, "proj.bias", c), vector(g, "ls1", c));
    let o = g.linear(o, proj, Some(bias)).expect("proj");
    let o = g.zip(Binary::Mul, o, gamma).expect("scale");
    let x = g.add_values(x, o).expect("residual");
    let (w2, b2) = (vector(g, "norm2.weight", c), vector(g, "norm2.bias", c));
    let xn = g.layer_norm(x, Some(w2), Some(b2), 1e-6).expect("norm");
    let (fc1, fc2) = (g.parameter(&format!("{name}.fc1"), [4 * c, c]), g.parameter(&format!("{name}.fc2"), [c, 4 * c]));
    let h = g.linear(xn, fc1, None).expect("fc1");
    let h = g.map(Unary::Gelu, h);
    let h = g.linear(h, fc2, None).expect("fc2");
    g.add_values(x, h).expect("residual")
}

/// Input `[groups · tokens, c]`, one local block, one global block, output `y`.
pub(crate) fn two_blocks(groups: usize, tokens: usize, heads: (usize, usize)) -> Graph {
    let mut g = Graph::new();
    let x = g.input("x", [groups * tokens, heads.0 * heads.1]);
    let x = block(&mut g, x, groups, heads, "local");
    let x = block(&mut g, x, 1, heads, "global");
    g.output(x, "y");
    g
}
