//! A whole network in training, all of its results in the loss: the gradient of a tensor along a direction in it.
//!
//! A network this deep has second derivatives that a step of 1e-5 would show, and kinks (ReLU, sampled cells) that it might meet: it is
//! 1e-7 here. A slope along random signs is about as large as the gradient's norm, of which the bound is a part.

use std::collections::BTreeMap;
use std::path::Path;

use omnix::bench::RandomWeights;
use omnix_graph::graph::Source;
use omnix_graph::passes::adopt::gradient_output;
use omnix_graph::{Graph, GraphError, ParameterSource as _, Plan, PlanOptions, Value};
use omnix_kernels::WeightType;
use omnix_model::{DRAW, Dropout, Network, NetworkConfig, TrainingSpec};
use omnix_tests::{Rng, Trial, gpu, trials};
use serde_json::json;

use crate::case::Case;

/// Measured: at most 1.9e-4 (patches, through which everything else passes) over all 489 tensors of the release's network.
const BOUND: f64 = 3e-4;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "network",
        once: [
            gradients_of_the_release,
            gradients_of_the_paper,
            every_tensor_of_every_variant_is_trained,
            parameters_as_inputs_and_little_memory_change_no_bit,
            values_computed_again_change_no_bit,
        ],
    )
}

/// A golden network's configuration with fields of `trajectory` replaced.
fn edited(changes: &serde_json::Value) -> NetworkConfig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/model/mixed.json");
    let mut settings: serde_json::Value = serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON");
    for (name, value) in changes.as_object().expect("fields") {
        settings["trajectory"][name] = value.clone();
    }
    NetworkConfig::from_json(&settings).expect("a network")
}

/// The network in training, with random weights and pictures; its loss.
fn recorded(changes: &serde_json::Value, dropout: Option<Dropout>) -> (Case, Value) {
    let config = edited(changes);
    let mut graph = Graph::new();
    let spec = TrainingSpec { images: 2, grid: (2, 3), motion: true, ungated: true, dropout, inference: false };
    let made = Network::new(config.clone()).training(&mut graph, &spec).expect("records");
    let weights = RandomWeights::new(&config);
    let mut data = BTreeMap::new();
    for (_, info) in graph.values() {
        match &info.source {
            Source::Parameter(p) => {
                data.insert(p.name.to_string(), weights.read(&p.name).expect("a tensor").into_owned());
            }
            // u32 in the bits of an f32.
            Source::Input if info.name == DRAW => {
                data.insert(info.name.clone(), vec![f32::from_bits(3)]);
            }
            Source::Input if info.name == "images" => {
                data.insert(info.name.clone(), Rng::new(5).normal(info.shape.elements()));
            }
            _ => {}
        }
    }
    for code in &made.codes {
        data.insert(code.name.clone(), code.of(&[(0, 0), (1, 3)]));
    }
    let motion = made.motion.expect("motion");
    let mut outputs = vec![made.pose_codes, made.depth, made.depth_confidence, made.rays.0, made.rays.1];
    outputs.extend(made.points);
    outputs.extend([motion.trajectories, motion.confidence, motion.theta, motion.score]);
    outputs.extend(motion.ungated);
    let mut case = Case::of(&changes.to_string(), graph, data);
    let loss = case.loss(&outputs);
    (case, loss)
}

/// Compares the gradients of the tensors whose place among all is `first` after a multiple of `step`, and of those that score tokens.
fn check(changes: &serde_json::Value, dropout: Option<Dropout>, first: usize, step: usize) {
    let (case, loss) = recorded(changes, dropout);
    let gradients = case.gradients(gpu(), loss).into_iter().enumerate();
    let some = gradients.filter(|(i, (name, _))| i % step == first || name.contains("dynamic_pred_last"));
    let some: Vec<(String, Vec<f32>)> = some.map(|(_, gradient)| gradient).collect();
    for (name, [got, want, norm]) in case.slopes(loss, &some) {
        let off = (got - want).abs();
        assert!(norm > 0.0 && off <= BOUND * norm, "{changes}, {name}: slope {got:e}, not {want:e}, of {norm:e}");
    }
}

fn gradients_of_the_release() {
    check(&json!({}), Some(Dropout { share: 0.3, seed: 11 }), 5, 40);
}

fn gradients_of_the_paper() {
    let changes = json!({
        "time_gain": "adaln", "motion_gate": { "kind": "blend" }, "sampled_score": "score", "token_features": "last",
    });
    check(&changes, None, 11, 50);
}

fn every_tensor_of_every_variant_is_trained() {
    for changes in [
        json!({}),
        json!({ "token_features": "last" }),
        json!({ "token_points": false }),
        json!({ "qk_norm": false }),
        json!({ "rope_base": null }),
        json!({ "layer_scale": false }),
        json!({ "time_gain": "none" }),
        json!({ "time_gain": "adaln" }),
        json!({ "time_gain": "token_adaln" }),
        json!({ "same_time_blocks": [] }),
        json!({ "same_time_blocks": [0, 1, 2, 3, 4] }),
        json!({ "top_fraction": 1.0 }),
        json!({ "temporal_blocks": [0, 2] }),
        json!({ "spatial_blocks": [1, 4] }),
        json!({ "temporal_blocks": [1], "spatial_blocks": [1] }),
        json!({ "no_cross_blocks": [0, 3] }),
        json!({ "field": "translation" }),
        json!({ "sampled_score": "score" }),
        json!({ "motion_gate": { "kind": "blend" } }),
        json!({ "relative_to_own_time": false }),
    ] {
        let (case, loss) = recorded(&changes, None);
        let mut graph = case.graph.clone();
        let found = graph.gradients(loss, &|_| true).unwrap_or_else(|error| panic!("{changes}: {error}"));
        let missing: Vec<&String> = case.parameters().filter(|name| !found.contains(name)).collect();
        assert!(missing.is_empty(), "{changes}: {missing:?} have no gradient");
        graph.adopt(&found, WeightType::F32).unwrap_or_else(|error| panic!("{changes}: {error}"));
    }
}

fn parameters_as_inputs_and_little_memory_change_no_bit() {
    let (mut case, loss) = recorded(&json!({}), None);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let adopted = graph.adopt(&names, WeightType::F32).expect("adopts");
    let read = |case: &Case, graph: &Graph| {
        let executable = case.run(gpu(), graph);
        let read = |name: &String| executable.read(&gradient_output(name)).expect("reads");
        names.iter().map(read).collect::<Vec<_>>()
    };
    let want = read(&case, &graph);
    let same = |got: Vec<Vec<f32>>, what: &str| {
        for ((name, got), want) in names.iter().zip(got).zip(&want) {
            assert_eq!(got, *want, "{name}, {what}");
        }
    };
    same(read(&case, &adopted), "parameters as inputs");
    let too_little = Plan::new(&adopted, &gpu().caps, &PlanOptions::default().budget(1)).expect_err("a byte");
    let GraphError::Budget { least, .. } = too_little else { panic!("{too_little}") };
    case.options = PlanOptions::default().budget(least);
    same(read(&case, &adopted), "the least memory");
}

fn values_computed_again_change_no_bit() {
    let (mut case, loss) = recorded(&json!({}), Some(Dropout { share: 0.3, seed: 11 }));
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let graph = graph.adopt(&names, WeightType::F32).expect("adopts");
    let whole = Plan::new(&graph, &gpu().caps, &PlanOptions::default()).expect("plans").working_bytes();
    let within = |budget: u64| PlanOptions::default().budget(budget).recompute(true);
    let too_little = Plan::new(&graph, &gpu().caps, &within(1)).expect_err("a byte");
    let GraphError::Budget { least, .. } = too_little else { panic!("{too_little}") };
    let mut want = Vec::new();
    for budget in [whole, u64::midpoint(whole, least), least] {
        let plan = Plan::new(&graph, &gpu().caps, &within(budget)).expect("fits");
        assert!(plan.working_bytes() <= budget && (plan.recomputed > 0) == (budget < whole), "{budget}");
        case.options = within(budget);
        let executable = case.run(gpu(), &graph);
        let got: Vec<_> = names.iter().map(|name| executable.read(&gradient_output(name)).expect("reads")).collect();
        if budget == whole {
            want = got;
        } else {
            assert!(got == want, "{budget} bytes changed a gradient");
        }
    }
}
