//! The paper's ablations and the release's readings, by editing the configuration: each is recorded, planned for two kinds
//! of device, run on one, and agrees with the interpreter; what follows from a setting is checked by itself.

use std::ops::ControlFlow;

use omnix::bench::RandomWeights;
use omnix_graph::{Bindings, Executable, Graph, ParameterSource as _, Plan, PlanOptions, WeightStore};
use omnix_kernels::Caps;
use omnix_model::{
    BackboneSpec, HeadSpec, ModelError, MotionSpec, Network, NetworkConfig, ReferenceChoice, SamplingSpec,
};
use omnix_tests::{Rng, gpu, interpret};
use serde_json::{Value, json};

use crate::fixture;

const IMAGES: usize = 3;
const GRID: (usize, usize) = (3, 2);
const CELLS: usize = GRID.0 * GRID.1;

/// A golden network's configuration with fields of `trajectory` replaced.
fn edited(changes: &Value) -> NetworkConfig {
    let mut settings = fixture::json("mixed");
    for (name, value) in changes.as_object().unwrap() {
        settings["trajectory"][name] = value.clone();
    }
    NetworkConfig::from_json(&settings).unwrap()
}

fn times() -> Vec<(u32, u32)> {
    vec![(0, 0), (0, 1), (1, 0)]
}

/// Random numbers for every input, the same for every configuration.
fn inputs(graph: &Graph) -> Vec<(String, Vec<f32>)> {
    let named = graph.values().filter(|(_, info)| matches!(info.source, omnix_graph::graph::Source::Input));
    named
        .map(|(_, info)| {
            let seed = info.name.bytes().map(u64::from).sum();
            (info.name.clone(), Rng::new(seed).normal(info.shape.elements()))
        })
        .collect()
}

/// Runs a graph on the device and in the interpreter; all outputs, which must agree and be finite.
fn both(graph: &Graph, config: &NetworkConfig, inputs: &[(String, Vec<f32>)]) -> Vec<(String, Vec<f32>)> {
    let weights = RandomWeights::new(config);
    for caps in [Caps::lavapipe(), Caps::baseline()] {
        let plan = Plan::new(graph, &caps, &PlanOptions::default()).unwrap();
        assert!(plan.working_bytes() > 0);
    }
    let plan = Plan::new(graph, &gpu().caps, &PlanOptions::default()).unwrap();
    let store = WeightStore::load(gpu(), &weights, &plan.weights, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let device = Executable::new(gpu(), plan, &store, &Bindings::default()).unwrap();
    inputs.iter().for_each(|(name, data)| device.write(name, data).unwrap());
    device.run(&mut |_, _| ControlFlow::Continue(())).unwrap();
    let given: Vec<(&str, &[f32])> = inputs.iter().map(|(n, d)| (n.as_str(), d.as_slice())).collect();
    let run = interpret::run(graph, &given, &|name| weights.read(name).unwrap().into_owned());
    let outputs = graph.outputs().iter().map(|v| {
        let name = graph.value_name(*v).to_owned();
        let (got, want) = (device.read(&name).unwrap(), run.rounded(*v));
        assert!(got.iter().all(|x| x.is_finite()), "{name} is not finite");
        let size = want.iter().fold(1e-6f32, |m, x| m.max(x.abs()));
        let worst = got.iter().zip(&want).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
        assert!(worst < 2e-4 * size, "{name}: {worst} of {size}");
        (name, got)
    });
    outputs.collect()
}

fn output<'a>(outputs: &'a [(String, Vec<f32>)], name: &str) -> &'a [f32] {
    &outputs.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("no {name}")).1
}

/// The module's outputs under a configuration, and the sampling head's on top of them.
fn module(config: &NetworkConfig) -> Vec<(String, Vec<f32>)> {
    let network = Network::new(config.clone());
    let mut graph = Graph::new();
    network.motion(&mut graph, &MotionSpec { images: IMAGES, grid: GRID, times: times(), forced: false }).unwrap();
    let mut outputs = both(&graph, config, &inputs(&graph));
    let mut graph = Graph::new();
    network.sampling(&mut graph, &SamplingSpec { frames: IMAGES, times: IMAGES, grid: GRID }).unwrap();
    let mut given = inputs(&graph);
    for (name, data) in &mut given {
        if let "field" | "mask" = name.as_str() {
            *data = output(&outputs, name).to_vec();
        }
    }
    outputs.extend(both(&graph, config, &given));
    outputs
}

fn field(changes: &Value) -> Vec<f32> {
    output(&module(&edited(changes)), "field").to_vec()
}

#[test]
fn heads_of_any_width_that_can_be_rotated() {
    // Widths of heads 4, 12, 20, 36 and 100, in the encoder and in the trajectory module.
    for (width, heads) in [(48, 12), (48, 4), (80, 4), (72, 2), (100, 1)] {
        let mut settings = fixture::json("mixed");
        for part in ["backbone", "trajectory"] {
            let width_of = if part == "backbone" { "embed_dim" } else { "width" };
            settings[part][width_of] = json!(width);
            settings[part]["heads"] = json!(heads);
        }
        let config = NetworkConfig::from_json(&settings).unwrap();
        let spec = BackboneSpec {
            images: IMAGES,
            grid: GRID,
            reference: ReferenceChoice::First,
            cameras_given: false,
            times: times(),
            export_layers: Vec::new(),
        };
        let mut graph = Graph::new();
        Network::new(config.clone()).backbone(&mut graph, &spec).unwrap();
        both(&graph, &config, &inputs(&graph));
        module(&config);
    }
}

#[test]
fn every_switch_runs_and_changes_something() {
    let release = field(&json!({}));
    for changes in [
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
        json!({ "top_fraction": 0.5 }),
        json!({ "top_fraction": 0.6, "top_rounding": "ceil" }),
        json!({ "field_rest": [0, 0, 0, 0, 0, 0, 0, 0, 0] }),
        json!({ "temporal_blocks": [0, 2] }),
        json!({ "spatial_blocks": [1, 4] }),
        json!({ "temporal_blocks": [1], "spatial_blocks": [1] }),
        json!({ "no_cross_blocks": [0, 3] }),
        json!({ "field": "translation" }),
    ] {
        assert!(release != field(&changes), "{changes}");
    }
    // What changes the sampling head, not the field.
    let offsets = |changes: Value| output(&module(&edited(&changes)), "offsets").to_vec();
    let mut head = fixture::json("mixed")["trajectory"]["head"].clone();
    head["salient_max"] = false.into();
    let release = offsets(json!({}));
    assert!(release != offsets(json!({ "head": head })));
    assert!(release != offsets(json!({ "sampled_score": "score" })));
}

#[test]
fn the_fractions_of_the_paper_choose_so_many_tokens() {
    for (fraction, rounding, chosen) in [
        (0.1, "floor", 1),
        (0.2, "floor", 1),
        (0.3, "floor", 1),
        (0.3, "ceil", 2),
        (0.3, "nearest", 2),
        (1.0, "floor", 6),
    ] {
        let outputs = module(&edited(&json!({ "top_fraction": fraction, "top_rounding": rounding })));
        let mask = output(&outputs, "mask");
        for image in mask.chunks_exact(CELLS) {
            assert_eq!(image.iter().sum::<f32>() as usize, chosen, "{fraction} {rounding}");
        }
        // Of the highest scores.
        for (mask, score) in mask.chunks_exact(CELLS).zip(output(&outputs, "traj.score").chunks_exact(CELLS)) {
            let of = |on: bool| score.iter().zip(mask).filter(move |(_, m)| (**m > 0.5) == on).map(|(s, _)| *s);
            assert!(of(true).fold(2.0, f32::min) >= of(false).fold(-1.0, f32::max));
        }
    }
}

#[test]
fn the_probability_is_sampled_where_the_paper_says_so() {
    let outputs = module(&edited(&json!({ "sampled_score": "score" })));
    assert_eq!(output(&outputs, "mask"), output(&outputs, "traj.score"));
}

#[test]
fn a_translation_turns_nothing() {
    let all = field(&json!({ "field": "translation", "top_fraction": 1.0 }));
    assert!(all.chunks_exact(9).all(|cell| cell[..6] == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    assert!(all.chunks_exact(9).any(|cell| cell[6..].iter().any(|v| *v != 0.0)));
}

#[test]
fn tokens_that_are_not_chosen_hold_the_rest() {
    let rest = [0.5, -1.0, 2.0, 0.25, 3.0, 0.0, 1.0, -2.0, 7.0];
    let outputs = module(&edited(&json!({ "field_rest": rest })));
    let (field, mask) = (output(&outputs, "field"), output(&outputs, "mask"));
    let levels = field.len() / (IMAGES * IMAGES * CELLS * 9);
    for (at, cell) in field.chunks_exact(9).enumerate() {
        let (source, place) = (at / (levels * IMAGES * CELLS), at % CELLS);
        let chosen = mask[source * CELLS + place] > 0.5;
        assert_eq!(cell != rest, chosen, "cell {place} of image {source}");
    }
}

#[test]
fn times_tell_images_apart() {
    // Without a time code two target times of one video and frame are one time: queries of both see all the same.
    let config = edited(&json!({ "same_time_blocks": [], "top_fraction": 1.0 }));
    let network = Network::new(config.clone());
    let run = |times: Vec<(u32, u32)>| {
        let mut graph = Graph::new();
        network.motion(&mut graph, &MotionSpec { images: IMAGES, grid: GRID, times, forced: false }).unwrap();
        output(&both(&graph, &config, &inputs(&graph)), "field").to_vec()
    };
    let at = |field: &[f32], time: usize| field[time * CELLS * 9..][..CELLS * 9].to_vec();
    let same = run(vec![(0, 4), (0, 4), (0, 5)]);
    assert!(at(&same, 0) == at(&same, 1));
    assert!(at(&same, 0) != at(&same, 2));
    let videos = run(vec![(0, 4), (1, 4), (0, 5)]);
    assert!(at(&videos, 0) != at(&videos, 1));
}

#[test]
fn points_follow_the_camera_where_the_configuration_says_so() {
    let mut settings = fixture::json("mixed");
    settings["points_from"] = "camera".into();
    let config = NetworkConfig::from_json(&settings).unwrap();
    let mut graph = Graph::new();
    let spec = HeadSpec { frames: 1, grid: GRID, rays: false, points: true, gaussians: false };
    Network::new(config.clone()).head(&mut graph, &spec).unwrap();
    let (height, width) = (GRID.0 * 14, GRID.1 * 14);
    let (sin, cos) = (0.6f32, 0.8f32);
    let camera = omnix_geometry::Camera {
        extrinsics: [[cos, 0.0, sin, 0.3], [0.0, 1.0, 0.0, -0.2], [-sin, 0.0, cos, 0.5]],
        intrinsics: [[30.0, 0.0, 14.0], [0.0, 28.0, 21.0], [0.0, 0.0, 1.0]],
    };
    let mut given = inputs(&graph);
    let rays = given.iter_mut().find(|(name, _)| name == "camera_rays").unwrap();
    rays.1 = omnix_geometry::corner_rays(&camera, [height, width]).unwrap().to_vec();
    let outputs = both(&graph, &config, &given);
    let (depth, points) = (output(&outputs, "depth"), output(&outputs, "points"));
    for (pixel, point) in points.chunks_exact(3).enumerate() {
        let (u, v, z) = ((pixel % width) as f32, (pixel / width) as f32, depth[pixel]);
        // World to camera, then into the picture, must give the pixel and its depth back.
        let row = |r: usize| (0..3).map(|c| camera.extrinsics[r][c] * point[c]).sum::<f32>() + camera.extrinsics[r][3];
        let (x, y, found) = (row(0), row(1), row(2));
        assert!((found - z).abs() < 1e-3 * z.max(1.0), "depth {found} for {z}");
        assert!((30.0 * x / found + 14.0 - u).abs() < 0.02 && (28.0 * y / found + 21.0 - v).abs() < 0.02);
    }
}

#[test]
fn what_nobody_described_is_refused_by_name() {
    for name in ["fine_queries", "fixed_offsets", "neighbour_damping"] {
        let mut settings = fixture::json("mixed");
        settings["trajectory"][name] = true.into();
        let error = NetworkConfig::from_json(&settings).unwrap_err();
        assert!(matches!(error, ModelError::BadField { .. }) && error.to_string().contains(name), "{error}");
        settings["trajectory"][name] = false.into();
        NetworkConfig::from_json(&settings).unwrap();
    }
}

#[test]
fn geometry_networks_have_no_motion() {
    let network = Network::new(NetworkConfig::small());
    let mut graph = Graph::new();
    let asked =
        network.motion(&mut graph, &MotionSpec { images: 2, grid: GRID, times: vec![(0, 0); 2], forced: false });
    let error = asked.unwrap_err().to_string();
    assert!(error.contains("trajectories") && error.contains("da3-small"), "{error}");
}
