//! A small graph under test, with what its inputs and parameters hold, and the comparison of its gradients.
//!
//! The loss is the sum of random weights times all outputs, so that every number of them matters. The derivative of the loss with
//! respect to a number x is (loss(x + h) − loss(x − h)) / 2h in f64 with h = 1e-5 · max(|x|, 0.1), whose error is in the order of 1e-9;
//! what is straight-through changes with what stands for it (`Run::near`).
//! A tensor with many numbers is checked at some of them, and as a whole along random directions. The device computes in f32: 1e-4 in norm,
//! relative to the tensor's gradient.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use omnix_graph::graph::Source;
use omnix_graph::ops::{Binary, ReduceOp};
use omnix_graph::passes::adopt::gradient_output;
use omnix_graph::{Bindings, Executable, Graph, ParameterSource, Plan, PlanOptions, Shape, Value, WeightStore};
use omnix_kernels::Gpu;
use omnix_tests::interpret::{self, Run};
use omnix_tests::{Rng, assert_close, family};

/// Bound of the relative error in norm.
const BOUND: f64 = 1e-4;

/// Bound of the relative error in norm of what gradients are of.
const FORWARD: f64 = 1e-5;

/// A tensor of at most this number of elements is checked at each.
const EACH: usize = 48;

/// A graph under test.
#[derive(Debug)]
pub(crate) struct Case {
    /// For messages.
    pub(crate) name: String,
    /// The forward computation.
    pub(crate) graph: Graph,
    /// What inputs and parameters hold.
    pub(crate) data: BTreeMap<String, Vec<f32>>,
    /// How it is planned.
    pub(crate) options: PlanOptions,
    /// Inputs whose gradients are checked.
    leaves: Vec<(String, Value)>,
    /// Parameters, all of which are checked.
    parameters: Vec<String>,
}

impl Case {
    /// An empty graph.
    pub(crate) fn new(name: impl Into<String>) -> Self {
        let (graph, data, options) = (Graph::new(), BTreeMap::new(), PlanOptions::default());
        Self { name: name.into(), graph, data, options, leaves: Vec::new(), parameters: Vec::new() }
    }

    /// A graph recorded elsewhere, with what its inputs and parameters hold; all parameters are checked.
    pub(crate) fn of(name: &str, graph: Graph, data: BTreeMap<String, Vec<f32>>) -> Self {
        let mut parameters = Vec::new();
        for (_, info) in graph.values() {
            if let Source::Parameter(p) = &info.source
                && !parameters.iter().any(|known: &String| **known == *p.name)
            {
                parameters.push(p.name.to_string());
            }
        }
        Self { graph, data, parameters, ..Self::new(name) }
    }

    /// The names of its parameters.
    pub(crate) fn parameters(&self) -> impl Iterator<Item = &String> {
        self.parameters.iter()
    }

    /// Numbers that depend on `name` and the case's own.
    pub(crate) fn numbers(&self, name: &str, count: usize) -> Vec<f32> {
        let seed = self.name.bytes().chain(name.bytes());
        Rng::new(seed.fold(7u64, |s, b| s.wrapping_mul(31).wrapping_add(u64::from(b)))).normal(count)
    }

    /// An input of random numbers whose gradient is checked.
    pub(crate) fn leaf(&mut self, name: &str, shape: impl Into<Shape>) -> Value {
        self.leaf_of(name, shape, |v| v)
    }

    /// As [`Case::leaf`], each random number changed by `map`: away from kinks, into the domain.
    pub(crate) fn leaf_of(&mut self, name: &str, shape: impl Into<Shape>, map: impl Fn(f32) -> f32) -> Value {
        let shape = shape.into();
        let data = self.numbers(name, shape.elements()).into_iter().map(map).collect();
        let value = self.given(name, shape, data);
        self.leaves.push((name.to_owned(), value));
        value
    }

    /// An input of these numbers whose gradient is checked.
    pub(crate) fn leaf_with(&mut self, name: &str, shape: impl Into<Shape>, data: Vec<f32>) -> Value {
        let value = self.given(name, shape, data);
        self.leaves.push((name.to_owned(), value));
        value
    }

    /// An input that nothing is differentiated by.
    pub(crate) fn given(&mut self, name: &str, shape: impl Into<Shape>, data: Vec<f32>) -> Value {
        let shape = shape.into();
        assert_eq!(shape.elements(), data.len(), "{}: {name}", self.name);
        self.data.insert(name.to_owned(), data);
        self.graph.input(name, shape)
    }

    /// An input of indices.
    pub(crate) fn indices(&mut self, name: &str, shape: impl Into<Shape>, indices: &[u32]) -> Value {
        self.given(name, shape, indices.iter().map(|i| f32::from_bits(*i)).collect())
    }

    /// A tensor of the checkpoint, of random numbers that keep sums near one.
    pub(crate) fn parameter(&mut self, name: &str, shape: impl Into<Shape>) -> Value {
        let shape = shape.into();
        self.tensor(name, &shape);
        self.graph.parameter(name, shape)
    }

    /// The numbers of a tensor of the checkpoint, for parameters that are blocks of it.
    pub(crate) fn tensor(&mut self, name: &str, shape: &Shape) {
        let depth = shape.get(1..).map_or(1, |dims| dims.iter().product::<usize>()).max(1);
        let data = self.numbers(name, shape.elements()).iter().map(|v| v / (depth as f32).sqrt()).collect();
        if self.data.insert(name.to_owned(), data).is_none() {
            self.parameters.push(name.to_owned());
        }
    }

    /// The sum of random weights times each of `outputs`.
    pub(crate) fn loss(&mut self, outputs: &[Value]) -> Value {
        let mut sum = None;
        for (i, output) in outputs.iter().enumerate() {
            let n = self.graph.shape(*output).elements();
            let name = format!("weights.{i}");
            let weights = self.numbers(&name, n);
            let weights = self.graph.constant(&name, [n], weights);
            let flat = self.graph.reshape(*output, [n]).expect("flat");
            let weighted = self.graph.zip(Binary::Mul, flat, weights).expect("weighted");
            let part = self.graph.reduce(weighted, ReduceOp::Sum, 0).expect("a sum");
            sum = Some(match sum {
                None => part,
                Some(sum) => self.graph.add_values(sum, part).expect("the sum of outputs"),
            });
        }
        sum.expect("an output")
    }

    /// Compares the gradients of [`Case::loss`] of `outputs` with central differences, and `outputs` with the interpreter's.
    pub(crate) fn check(mut self, gpu: &Gpu, outputs: &[Value]) {
        let loss = self.loss(outputs);
        let what = format!("{} ({})", self.name, family(gpu));
        let read = |wanted: &str| interpret::wide(&self.data[wanted]);
        let base = interpret::run_f64(&self.graph, &read, &read);
        let mut graph = self.graph.clone();
        for (i, output) in outputs.iter().enumerate() {
            keep(&mut graph, *output, &format!("output.{i}"));
        }
        let (executable, names) = self.differentiated(gpu, graph, loss);
        for (i, output) in outputs.iter().enumerate() {
            let got = executable.read(&format!("output.{i}")).expect("reads");
            assert_close(&format!("{what}: output {i}"), &got, &base.rounded(*output), FORWARD);
        }
        for name in names {
            let gradient = executable.read(&gradient_output(&name)).expect("reads");
            self.compare_near(&what, &base, loss, &name, &gradient);
        }
    }

    /// The gradients of `loss` on the device by name: of all leaves and parameters, which must have one.
    pub(crate) fn gradients(&self, gpu: &Gpu, loss: Value) -> Vec<(String, Vec<f32>)> {
        let (executable, names) = self.differentiated(gpu, self.graph.clone(), loss);
        let read = |name: String| {
            let gradient = executable.read(&gradient_output(&name)).expect("reads");
            (name, gradient)
        };
        names.into_iter().map(read).collect()
    }

    /// Runs `graph` with the gradients of `loss`, and says of what.
    fn differentiated(&self, gpu: &Gpu, mut graph: Graph, loss: Value) -> (Executable, Vec<String>) {
        let what = format!("{} ({})", self.name, family(gpu));
        let leaves: Vec<Value> = self.leaves.iter().map(|(_, value)| *value).collect();
        let found = graph.differentiate(loss, &leaves).unwrap_or_else(|error| panic!("{what}: {error}"));
        let mut names = Vec::new();
        for ((name, _), gradient) in self.leaves.iter().zip(found) {
            let gradient = gradient.unwrap_or_else(|| panic!("{what}: {name} has no gradient"));
            keep(&mut graph, gradient, &gradient_output(name));
            names.push(name.clone());
        }
        let found = graph.gradients(loss, &|_| true).unwrap_or_else(|error| panic!("{what}: {error}"));
        let mut wanted = self.parameters.clone();
        wanted.sort_unstable();
        assert_eq!(found, wanted, "{what}: parameters with a gradient, in the order of their names");
        names.extend(found);
        (self.run(gpu, &graph), names)
    }

    /// Compares the gradient of one tensor.
    pub(crate) fn compare(&self, what: &str, loss: Value, name: &str, gradient: &[f32]) {
        let read = |wanted: &str| interpret::wide(&self.data[wanted]);
        self.compare_near(what, &interpret::run_f64(&self.graph, &read, &read), loss, name, gradient);
    }

    /// Compares the gradient of one tensor at `base`.
    fn compare_near(&self, what: &str, base: &Run<'_>, loss: Value, name: &str, gradient: &[f32]) {
        let n = self.data[name].len();
        assert_eq!(gradient.len(), n, "{what}: {name} has a gradient of another length");
        let steps = self.data[name].iter().map(|v| 1e-5 * f64::from(v.abs().max(0.1)));
        let steps: Vec<f64> = steps.collect();
        let mut rng = Rng::new(n as u64);
        let some: Vec<usize> =
            if n <= EACH { (0..n).collect() } else { (0..EACH).map(|_| rng.below(n as u32) as usize).collect() };
        let slope = |direction: &dyn Fn(usize) -> f64| {
            let at = |sign: f64| self.loss_at(base, loss, name, &|i| sign * direction(i));
            (at(1.0) - at(-1.0)) / 2.0
        };
        let (mut error, mut norm) = (0.0, 0.0);
        let mut add = |got: f64, want: f64| {
            error += (got - want).powi(2);
            norm += want.powi(2);
        };
        for at in some {
            let want = slope(&|i| if i == at { steps[at] } else { 0.0 }) / steps[at];
            add(f64::from(gradient[at]), want);
        }
        if n > EACH {
            // Along a direction of random signs, each step as long as the shortest.
            let h = steps.iter().copied().fold(f64::INFINITY, f64::min);
            for _ in 0..4 {
                let signs: Vec<f64> = rng.normal(n).iter().map(|v| f64::from(v.signum())).collect();
                let want = slope(&|i| h * signs[i]) / h;
                let got = gradient.iter().zip(&signs).map(|(g, s)| f64::from(*g) * s).sum();
                add(got, want);
            }
        }
        let relative = if norm > 0.0 { (error / norm).sqrt() } else { error.sqrt() };
        assert!(relative <= BOUND, "{what}: the gradient of {name} is off by {relative:.3e}, more than {BOUND:.0e}");
    }

    /// The slope of the loss along a direction of random signs in each of some tensors, as the device's gradient says and as differences
    /// do, and the gradient's norm.
    pub(crate) fn slopes(&self, loss: Value, gradients: &[(String, Vec<f32>)]) -> Vec<(String, [f64; 3])> {
        let read = |wanted: &str| interpret::wide(&self.data[wanted]);
        let base = interpret::run_f64(&self.graph, &read, &read);
        let of = |(name, gradient): &(String, Vec<f32>)| {
            let signs: Vec<f64> =
                self.numbers(&format!("{name}, signs"), gradient.len()).iter().map(|v| f64::from(v.signum())).collect();
            let h = 1e-7;
            let at = |sign: f64| self.loss_at(&base, loss, name, &|i| sign * h * signs[i]);
            let got = gradient.iter().zip(&signs).map(|(g, s)| f64::from(*g) * s).sum();
            let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
            (name.clone(), [got, (at(1.0) - at(-1.0)) / (2.0 * h), norm])
        };
        gradients.iter().map(of).collect()
    }

    /// The loss with some numbers of the tensor `name` moved.
    fn loss_at(&self, base: &Run<'_>, loss: Value, name: &str, moved: &dyn Fn(usize) -> f64) -> f64 {
        let read = |wanted: &str| {
            let data = interpret::wide(&self.data[wanted]);
            if wanted == name { data.iter().enumerate().map(|(i, v)| v + moved(i)).collect() } else { data }
        };
        base.near(&read, &read).get(loss)[0]
    }

    /// Runs `graph` on the device with the case's numbers.
    pub(crate) fn run(&self, gpu: &Gpu, graph: &Graph) -> Executable {
        let plan = Plan::new(graph, &gpu.caps, &self.options).expect("plans");
        let go_on = &mut |_, _| ControlFlow::Continue(());
        let store = WeightStore::load(gpu, &Read(&self.data), &plan.weights, go_on).expect("loads");
        let executable = Executable::new(gpu, plan, &store, &Bindings::default()).expect("prepares");
        for (_, info) in graph.values() {
            if matches!(info.source, Source::Input) {
                // What no node reads has no memory.
                if executable.slice(&info.name).is_ok() {
                    let name = info.name.strip_prefix("parameter.").unwrap_or(&info.name);
                    executable.write(&info.name, &self.data[name]).expect("writes");
                }
            }
        }
        executable.run(go_on).expect("runs");
        executable
    }
}

/// The case's parameters.
struct Read<'a>(&'a BTreeMap<String, Vec<f32>>);

impl ParameterSource for Read<'_> {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        Ok(self.0.get(name).ok_or_else(|| format!("no parameter {name}"))?.as_slice().into())
    }
}

/// Keeps a copy of `value` as an output, whatever else it is.
pub(crate) fn keep(graph: &mut Graph, value: Value, name: &str) {
    let n = graph.shape(value).elements();
    let flat = graph.reshape(value, [n]).expect("flat");
    let copy = graph.repeat(flat, 1).expect("a copy");
    graph.output(copy, name);
}

/// Moves a number to a distance of at least 0.05 from each kink.
pub(crate) fn away_from(kinks: &[f32]) -> impl Fn(f32) -> f32 {
    move |v| match kinks.iter().find(|kink| (v - *kink).abs() < 0.05) {
        Some(kink) if v < *kink => v - 0.05,
        Some(_) => v + 0.05,
        None => v,
    }
}
