//! Recorded tensors, and graphs run on given inputs.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use omnix_graph::{Bindings, Executable, Graph, ParameterSource, Plan, PlanOptions, Value, WeightStore};
use omnix_kernels::Gpu;
use omnix_tensors::TensorFile;

/// The graphs of this binary have no parameters.
struct NoParameters;

impl ParameterSource for NoParameters {
    fn read(&self, name: &str) -> Result<std::borrow::Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        Err(format!("no parameter {name}").into())
    }
}

/// A file of recorded tensors, and the numbers that belong to it.
pub(crate) struct Recorded {
    tensors: TensorFile,
    pub(crate) numbers: serde_json::Value,
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/training").join(name)
}

impl Recorded {
    /// `NAME.safetensors` and `NAME.json` of `tests/data/training`.
    pub(crate) fn open(name: &str) -> Self {
        let tensors = TensorFile::open(&file(&format!("{name}.safetensors"))).unwrap();
        let text = std::fs::read(file(&format!("{name}.json"))).unwrap();
        Self { tensors, numbers: serde_json::from_slice(&text).unwrap() }
    }

    /// A tensor as f32; bytes are numbers.
    pub(crate) fn get(&self, name: &str) -> Vec<f32> {
        let info = self.tensors.info(name).unwrap_or_else(|| panic!("{name} is recorded"));
        match info.dtype.as_str() {
            "U8" | "BOOL" => self.tensors.tensor_bytes(name).unwrap().iter().map(|b| f32::from(*b)).collect(),
            _ => self.tensors.tensor(name).unwrap().to_f32(),
        }
    }

    pub(crate) fn shape(&self, name: &str) -> Vec<usize> {
        self.tensors.info(name).unwrap().shape.clone()
    }

    /// The number at `path`, keys with slashes between them.
    pub(crate) fn number(&self, path: &str) -> f64 {
        let found = self.numbers.pointer(&format!("/{path}")).and_then(serde_json::Value::as_f64);
        found.unwrap_or_else(|| panic!("{path} is recorded"))
    }
}

/// Inputs of a graph with their numbers.
pub(crate) type Inputs = Vec<(String, Vec<f32>)>;

/// A graph with inputs that have numbers.
#[derive(Default)]
pub(crate) struct Case {
    pub(crate) graph: Graph,
    pub(crate) inputs: Inputs,
}

impl Case {
    /// An input with its numbers.
    pub(crate) fn input(&mut self, name: &str, shape: &[usize], data: Vec<f32>) -> Value {
        self.inputs.push((name.to_owned(), data));
        self.graph.input(name, shape)
    }

    /// Replaces an input's numbers.
    pub(crate) fn set(&mut self, name: &str, data: Vec<f32>) {
        self.inputs.iter_mut().find(|(known, _)| known == name).unwrap().1 = data;
    }

    /// The numbers of an input.
    pub(crate) fn data(&self, name: &str) -> &[f32] {
        &self.inputs.iter().find(|(known, _)| known == name).unwrap().1
    }

    /// Records the gradient of `loss` for each input of `leaves`, as outputs `gradient.NAME`.
    pub(crate) fn differentiate(&mut self, loss: Value, leaves: &[Value]) {
        let found = self.graph.differentiate(loss, leaves).expect("differentiates");
        for (leaf, gradient) in leaves.iter().zip(found) {
            let name = self.graph.value_name(*leaf).to_owned();
            self.graph
                .output(gradient.unwrap_or_else(|| panic!("the loss depends on {name}")), &format!("gradient.{name}"));
        }
    }

    /// Runs the graph.
    pub(crate) fn run(&self, gpu: &Gpu) -> Executable {
        let plan = Plan::new(&self.graph, &gpu.caps, &PlanOptions::default()).expect("plans");
        let keep_on = &mut |_, _| ControlFlow::Continue(());
        let store = WeightStore::load(gpu, &NoParameters, &plan.weights, keep_on).expect("loads");
        let ready = Executable::new(gpu, plan, &store, &Bindings::default()).expect("prepares");
        for (name, data) in &self.inputs {
            ready.write(name, data).unwrap_or_else(|e| panic!("{name}: {e}"));
        }
        ready.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
        ready
    }
}

/// The one number of an output.
pub(crate) fn number(ready: &Executable, name: &str) -> f64 {
    let got = ready.read(name).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(got.len(), 1, "{name} is one number");
    f64::from(got[0])
}

/// Asserts that an output is within `limit` of `want`, relatively.
#[track_caller]
pub(crate) fn assert_number(ready: &Executable, name: &str, want: f64, limit: f64) {
    let got = number(ready, name);
    assert!((got - want).abs() <= limit * want.abs(), "{name}: {got}, want {want}");
}
