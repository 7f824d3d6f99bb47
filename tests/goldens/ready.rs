//! What all stages of a recorded case share: a graph made ready on the device, and where compared values go.

use std::ops::ControlFlow;

use omnix::graph::{Bindings, Executable, Graph, Plan, PlanOptions, WeightStore};
use omnix::{OmnixError, WeightType, Weights};
use omnix_tests::gpu;

/// Called with a recorded value's name, ours, and the recorded one.
pub(crate) type Report<'a> = &'a mut dyn FnMut(&str, &[f32], &[f32]);

/// Plans a graph, uploads its weights and makes its pipelines.
pub(crate) fn prepare(weights: &Weights, graph: &Graph, storage: WeightType) -> Result<Executable, OmnixError> {
    let plan = Plan::new(graph, &gpu().caps, &PlanOptions::default().storage(storage))?;
    let store = WeightStore::load(gpu(), weights, &plan.weights, &mut |_, _| ControlFlow::Continue(()))?;
    Ok(Executable::new(gpu(), plan, &store, &Bindings::default())?)
}
