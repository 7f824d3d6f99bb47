//! A training step against recordings: losses, gradients, and parameters after steps of AdamW.

use std::collections::BTreeMap;

use omnix::Weights;
use omnix::graph::ParameterSource as _;
use omnix_kernels::WeightType;
use omnix_tests::{gpu, relative_error};
use omnix_train::device::{DeviceStep, Objective, Optimiser, Room, Size, StepPlan};
use omnix_train::groups::Group;
use omnix_train::{LossConfig, LossValues, Part, Step as _, Update};
use serde_json::Value;

use crate::case::{Case, Comparison};
use crate::collect::Folder;

/// Of losses, relative.
const LOSS: f64 = 1e-5;
/// Of gradients, relative in norm; and of those that rounding moves by more than [`NOISE`].
const GRADIENT: f64 = 1e-4;
const NOISY_GRADIENT: f64 = 2e-3;
const NOISE: f64 = 1e-5;
/// Of losses after steps, relative.
const STEPPED: f64 = 1e-4;
/// Of a parameter's change over steps, relative in norm, or this many times what rounding moves it by.
const CHANGE: f64 = 1e-2;
const TIMES_NOISE: f64 = 20.0;
/// Mean and deviation that pictures are normalised by.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// Compares everything that the folder has.
pub(crate) fn run(folder: &Folder, total: &mut Comparison) -> Result<(), String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let weights = Weights::open(&folder.path).map_err(|e| text(&e))?;
    let losses = json(folder, "losses.json")?;
    for path in folder.cases() {
        let case = Case::open(&path)?;
        let mut step = ready(&weights, &case)?;
        let inputs = inputs(&step.1, &case)?;
        let found = step.0.train_on(&inputs).map_err(|e| text(&e))?;
        compare_losses(&losses, &found, total);
        gradients(&step.0, &case, &losses, total)?;
        if folder.file("steps.json").is_some() {
            steps(&mut step.0, &inputs, &weights, folder, found, total)?;
        }
    }
    Ok(())
}

fn json(folder: &Folder, name: &str) -> Result<Value, String> {
    let path = folder.file(name).ok_or_else(|| format!("no {name}"))?;
    serde_json::from_slice(&std::fs::read(path).map_err(|e| e.to_string())?).map_err(|e| e.to_string())
}

/// The network on the device with the recorded weights.
fn ready(weights: &Weights, case: &Case) -> Result<(DeviceStep, Vec<omnix::model::TimeCode>), String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let images = case.get("in.image").ok_or("no pictures")?;
    let [count, 3, height, width] = images.shape[..] else { return Err(format!("pictures {:?}", images.shape)) };
    let size = Size { images: count, grid: (height / 14, width / 14) };
    let loss = LossConfig::release();
    // The recording was made without dropout.
    let objective = Objective { loss: &loss, groups: &Group::release(), dropout: None };
    let room = Room { caps: &gpu().caps, budget: None, gradients: 0, averaged: false, copies: WeightType::F32 };
    let plan = StepPlan::new(weights.network(), size, objective, room);
    let plan = plan.map_err(|e| text(&e))?;
    let codes = plan.codes.clone();
    let optimiser = Optimiser { betas: [0.9, 0.95], eps: 1e-8, max_norm: 1.0, accumulate: 1, peers: 1 };
    let source = Box::new(weights.clone());
    let mut step = DeviceStep::new(gpu(), plan, optimiser, false, source).map_err(|e| text(&e))?;
    let layout = step.layout().clone();
    for (index, arena) in layout.arenas.iter().enumerate() {
        let mut numbers = vec![0.0; arena.range.len()];
        for slot in layout.slots.iter().filter(|slot| slot.arena == index) {
            let values = weights.read(&slot.name).map_err(|e| text(&e))?;
            numbers[slot.range.start - arena.range.start..][..values.len()].copy_from_slice(&values);
        }
        step.write(Part::Weights, index, &numbers).map_err(|e| text(&e))?;
    }
    Ok((step, codes))
}

/// What the case gives every input of the step.
fn inputs(codes: &[omnix::model::TimeCode], case: &Case) -> Result<Vec<(String, Vec<f32>)>, String> {
    let get = |name: &str| case.get(name).map(|t| t.data.clone()).ok_or_else(|| format!("no {name}"));
    let images = case.get("in.image").ok_or("no pictures")?;
    let (count, pixels) = (images.shape[0], images.shape[2] * images.shape[3]);
    let normal = |(i, v): (usize, &f32)| (v - MEAN[i / pixels % 3]) / DEVIATION[i / pixels % 3];
    let times: Vec<(u32, u32)> =
        get("in.video")?.iter().zip(get("in.frame")?).map(|(v, f)| (*v as u32, f as u32)).collect();
    let (valid, paths, ray, camera) =
        (get("in.valid")?, get("in.trajectory")?, get("gt.ray")?, get("gt.pose_encoding")?);
    let source = |entry: usize| entry / pixels / count * pixels + entry % pixels;
    let counts = |(i, p): (usize, &[f32; 3])| valid[source(i)] != 0.0 && p.iter().all(|v| v.is_finite());
    let known = paths.as_chunks().0.iter().enumerate().map(|at| f32::from(u8::from(counts(at)))).collect();
    let (pixel, token) = (get("gt.moving_label")?, get("gt.moving_label_token")?);
    let mut inputs: Vec<(String, Vec<f32>)> = codes.iter().map(|code| (code.name.clone(), code.of(&times))).collect();
    let targets = [
        ("images", images.data.iter().enumerate().map(normal).collect()),
        ("target.depth", get("in.depth")?),
        ("target.valid", valid.clone()),
        ("target.ray.valid", vec![1.0; ray.len() / 6]),
        ("target.ray", ray),
        ("target.camera.valid", vec![1.0; camera.len()]),
        ("target.camera", camera),
        ("target.paths.known", known),
        ("target.paths", paths.clone()),
        ("target.labelled.pixel", vec![1.0; pixel.len()]),
        ("target.label.pixel", pixel),
        ("target.labelled.token", vec![1.0; token.len()]),
        ("target.label.token", token),
    ];
    inputs.extend(targets.map(|(name, numbers)| (name.to_owned(), numbers)));
    Ok(inputs)
}

fn difference(got: f64, want: f64) -> f64 {
    (got - want).abs() / want.abs().max(1e-12)
}

fn compare_losses(recorded: &Value, found: &LossValues, total: &mut Comparison) {
    for (name, value) in &found.terms {
        if let Some(want) = recorded["losses"][name]["value"].as_f64() {
            total.note(&format!("loss {name}"), difference(*value, want), LOSS, true);
        }
    }
    let want = recorded["losses"]["total"].as_f64().or(recorded["total"].as_f64()).unwrap_or(f64::NAN);
    total.note("loss total", difference(found.total, want), LOSS, true);
}

fn gradients(step: &DeviceStep, case: &Case, recorded: &Value, total: &mut Comparison) -> Result<(), String> {
    for (name, tensor) in &case.tensors {
        let Some(parameter) = name.strip_prefix("grad.") else { continue };
        let got = step.gradient(parameter).map_err(|e| e.to_string())?;
        let noise = recorded["gradient_relative_noise"][parameter].as_f64().unwrap_or(0.0);
        let limit = if noise > NOISE { NOISY_GRADIENT } else { GRADIENT };
        total.compare(&format!("gradient of {parameter}"), &got, &tensor.data, limit, true);
    }
    Ok(())
}

/// Goes on with steps of AdamW, and compares losses and every parameter's change.
fn steps(
    step: &mut DeviceStep,
    inputs: &[(String, Vec<f32>)],
    weights: &Weights,
    folder: &Folder,
    first: LossValues,
    total: &mut Comparison,
) -> Result<(), String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let recorded = json(folder, "steps.json")?;
    let rows = recorded["steps"].as_array().cloned().unwrap_or_default();
    let groups = Group::release();
    let mut losses = first;
    for (number, row) in rows.iter().enumerate() {
        for (name, value) in &losses.terms {
            if let Some(want) = row[name].as_f64() {
                total.note(&format!("loss {name} at step {number}"), difference(*value, want), STEPPED, true);
            }
        }
        let Some(norm) = row["gradient_norm"].as_f64() else { break };
        let update = Update {
            step: number as u64 + 1,
            samples: 1,
            rates: groups.iter().map(|group| group.rate.unwrap_or(0.0)).collect(),
            decays: vec![0.05; groups.len()],
            clip: Some(1.0),
            average: None,
        };
        let found = step.apply(&update).map_err(|e| text(&e))?;
        total.note(&format!("gradient norm at step {number}"), difference(found, norm), STEPPED, true);
        losses = step.train_on(inputs).map_err(|e| text(&e))?;
    }
    let after = Case::open(&folder.file("steps.safetensors").ok_or("no steps.safetensors")?)?;
    let noise: BTreeMap<String, f64> =
        serde_json::from_value(recorded["delta_relative_noise_input_moved_by_1_ulp"].clone()).unwrap_or_default();
    for (name, want) in &after.tensors {
        // One norm that the ray head's four levels share; we know it as the first's.
        let ours = (1..4).fold(name.clone(), |name, level| {
            name.replace(&format!("output_conv2_aux.{level}.2."), "output_conv2_aux.0.2.")
        });
        let before = weights.read(&ours).map_err(|e| text(&e))?;
        let Ok(got) = step.weights(&ours) else {
            // Not trained: the recording left it alone too.
            total.compare(&format!("{name} untouched"), &before, &want.data, 0.0, false);
            continue;
        };
        let change = |after: &[f32]| after.iter().zip(&*before).map(|(a, b)| a - b).collect::<Vec<f32>>();
        let limit = CHANGE.max(TIMES_NOISE * noise.get(name).copied().unwrap_or(0.0));
        let error = relative_error(&change(&got), &change(&want.data));
        // Apart from the worst figure: the first steps of AdamW are near the sign of the gradient.
        total.note(&format!("change of {name}"), error, limit, false);
    }
    Ok(())
}
