//! The state of a training run on disk.
//!
//! ```text
//! OUT/last/   model.safetensors    the network's tensors (f32): the average of the weights where there is one, else the weights
//!             config.json          the network: the folder opens as a checkpoint of the program
//!             state.safetensors    `first.NAME`, `second.NAME`: AdamW's moments of every trained tensor;
//!                                  `weights.NAME`: the weights, where the model holds their average
//!             trainer.json         step, seed, samples drawn, best figure, versions, settings ([`Progress`])
//! OUT/best/   the same, of the step with the best validation (files shared with `last` where both are of the same step)
//! OUT/model.safetensors, OUT/config.json     those of `last`, so that OUT itself opens as a checkpoint
//! ```
//!
//! A checkpoint is written beside its place (`swap.rs`) and takes it when it is whole on the disk: whatever happens meanwhile, a full
//! disk included, the former one stays good. Moments are stored by tensor and not by place, so that a run may be continued with
//! other groups. Of a tensor that was frozen until then the moments are 0.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use omnix_tensors::{AtomicFile, Dtype, TensorFile, TensorSpec, TensorWriter, read_text};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::interface::{Part, Step};
use crate::{TrainError, swap};

/// Version of the layout; a higher one is refused.
pub const FORMAT: u32 = 1;
/// Name of the newest checkpoint's folder.
pub const LAST: &str = "last";
/// Name of the best one's.
pub const BEST: &str = "best";

const MODEL: &str = "model.safetensors";
const CONFIG: &str = "config.json";
const STATE: &str = "state.safetensors";
const TRAINER: &str = "trainer.json";
/// Bytes of a text file of a checkpoint at most.
const MAX_TEXT: u64 = 4 << 20;

/// The best validation of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Steps done when it was measured.
    pub step: u64,
    /// The figure; lower is better.
    pub figure: f64,
}

/// How far a run has come.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Version of the layout.
    pub format: u32,
    /// The program that wrote it.
    pub version: String,
    /// Steps done.
    pub step: u64,
    /// The seed of the data's order and of everything random in the network.
    pub seed: u64,
    /// Samples drawn: the next one has this number.
    pub samples: u64,
    /// The best validation so far.
    pub best: Option<Best>,
    /// Seconds of training so far.
    pub seconds: f64,
    /// The configuration, for the record and to tell what was changed since.
    pub settings: Value,
}

impl Progress {
    /// A run that has not begun.
    #[must_use]
    pub fn new(seed: u64, settings: Value) -> Self {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Self { format: FORMAT, version, step: 0, seed, samples: 0, best: None, seconds: 0.0, settings }
    }
}

/// Writes the checkpoint `OUT/last`.
///
/// # Errors
/// Numbers that cannot be read from the device, or files that cannot be written; then the former checkpoint is as it was.
pub fn save(
    out: &Path,
    network: &Value,
    progress: &Progress,
    step: &mut dyn Step,
    averaged: bool,
) -> Result<(), TrainError> {
    let mut write = |new: &Path| {
        let metadata = BTreeMap::from([("step".to_owned(), progress.step.to_string())]);
        write_model(&new.join(MODEL), network, &metadata, step, averaged)?;
        write_state(&new.join(STATE), &metadata, step, averaged)?;
        write_json(&new.join(CONFIG), network)?;
        write_json(&new.join(TRAINER), &serde_json::to_value(progress).unwrap_or_default())
    };
    swap::begin(out, LAST).and_then(|new| write(&new)).inspect_err(|_| {
        // Half a checkpoint takes room that a full disk does not have.
        let _ = swap::recover(out, LAST);
    })?;
    swap::finish(out, LAST)?;
    show(out, network)
}

/// Makes `OUT/best` of `OUT/last`.
///
/// # Errors
/// Files that cannot be written; then the former best is as it was.
pub fn save_best(out: &Path) -> Result<(), TrainError> {
    let (last, new) = (out.join(LAST), swap::begin(out, BEST)?);
    for name in [MODEL, CONFIG, STATE, TRAINER] {
        swap::link(&last.join(name), &new.join(name))?;
    }
    swap::finish(out, BEST)
}

/// Lets OUT itself show the newest checkpoint. The configuration stays the same throughout a run, so the two files fit at any moment.
fn show(out: &Path, network: &Value) -> Result<(), TrainError> {
    let shown = out.join(CONFIG);
    let same =
        read_text(&shown, MAX_TEXT).is_ok_and(|text| serde_json::from_str::<Value>(&text).is_ok_and(|v| v == *network));
    if !same {
        write_json(&shown, network)?;
    }
    swap::link_over(&out.join(LAST).join(MODEL), &out.join(MODEL))
}

/// The prefix under which a network's tensors are stored.
fn prefix(network: &Value) -> &str {
    network.get("key_prefix").and_then(Value::as_str).unwrap_or("")
}

fn write_model(
    path: &Path,
    network: &Value,
    metadata: &BTreeMap<String, String>,
    step: &mut dyn Step,
    averaged: bool,
) -> Result<(), TrainError> {
    let (prefix, layout) = (prefix(network), step.layout().clone());
    let trained = layout.slots.iter().map(|slot| (&slot.name, &slot.shape));
    let all = trained.chain(layout.fixed.iter().map(|(name, shape)| (name, shape)));
    let specs: Vec<TensorSpec> =
        all.map(|(name, shape)| TensorSpec::new(format!("{prefix}{name}"), Dtype::F32, shape.clone())).collect();
    let mut writer = TensorWriter::create(path, &specs, metadata)?;
    write_part(&mut writer, prefix, if averaged { Part::Average } else { Part::Weights }, step)?;
    for (name, _) in &layout.fixed {
        let values = step.fixed(name).map_err(TrainError::Step)?;
        writer.write_f32(&format!("{prefix}{name}"), &values)?;
    }
    writer.finish()?;
    Ok(())
}

fn write_state(
    path: &Path,
    metadata: &BTreeMap<String, String>,
    step: &mut dyn Step,
    averaged: bool,
) -> Result<(), TrainError> {
    let slots = step.layout().slots.clone();
    let parts = parts(averaged);
    let specs: Vec<TensorSpec> = parts
        .iter()
        .flat_map(|(_, label)| slots.iter().map(move |slot| (label, slot)))
        .map(|(label, slot)| TensorSpec::new(format!("{label}{}", slot.name), Dtype::F32, slot.shape.clone()))
        .collect();
    let mut writer = TensorWriter::create(path, &specs, metadata)?;
    for (part, label) in parts {
        write_part(&mut writer, label, part, step)?;
    }
    writer.finish()?;
    Ok(())
}

/// What the state file holds, and how its names begin.
fn parts(averaged: bool) -> Vec<(Part, &'static str)> {
    let weights = averaged.then_some((Part::Weights, "weights."));
    [(Part::First, "first."), (Part::Second, "second.")].into_iter().chain(weights).collect()
}

fn write_part(writer: &mut TensorWriter, label: &str, part: Part, step: &mut dyn Step) -> Result<(), TrainError> {
    let layout = step.layout().clone();
    for arena in 0..layout.arenas.len() {
        let numbers = step.read(part, arena).map_err(TrainError::Step)?;
        for slot in layout.of_arena(arena) {
            let range = layout.in_arena(slot);
            let values = numbers.get(range.clone()).ok_or_else(|| {
                TrainError::Step(
                    format!("{} numbers of an arena that has {} and more", numbers.len(), range.end).into(),
                )
            })?;
            // What is not finite never replaces a checkpoint that is.
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(TrainError::StateNotFinite { tensor: slot.name.clone(), index, value: values[index] });
            }
            writer.write_f32(&format!("{label}{}", slot.name), values)?;
        }
    }
    Ok(())
}

fn write_json(path: &Path, value: &Value) -> Result<(), TrainError> {
    let text = format!("{value:#}\n");
    let write = || {
        let mut file = AtomicFile::create(path)?;
        file.write_all(text.as_bytes())?;
        file.commit()
    };
    write().map(|_| ()).map_err(|source| TrainError::Write { path: path.to_owned(), source })
}

/// A checkpoint of a training run that was opened and checked.
#[derive(Debug)]
pub struct Saved {
    path: PathBuf,
    progress: Progress,
    prefix: String,
    model: TensorFile,
    state: TensorFile,
}

impl Saved {
    /// Opens `OUT/last` for a run of the network with this `config.json`; none where no checkpoint is. What a killed run left half
    /// done is completed or taken away.
    ///
    /// # Errors
    /// A checkpoint of another network, of a newer program, or that is damaged, cut short or mixed from two.
    pub fn open(out: &Path, network: &Value) -> Result<Option<Self>, TrainError> {
        [LAST, BEST].iter().try_for_each(|name| swap::recover(out, name))?;
        Self::look(out, network)
    }

    /// [`Saved::open`] in a folder that another process writes to: nothing is completed or taken away.
    ///
    /// # Errors
    /// As [`Saved::open`].
    pub fn look(out: &Path, network: &Value) -> Result<Option<Self>, TrainError> {
        let path = out.join(LAST);
        if !path.exists() {
            return Ok(None);
        }
        let damaged = |reason: String| TrainError::BadCheckpoint { path: path.clone(), reason };
        let read = |name: &str| {
            let text = read_text(&path.join(name), MAX_TEXT)?;
            serde_json::from_str::<Value>(&text).map_err(|e| damaged(format!("{name}: {e}")))
        };
        let trainer = read(TRAINER)?;
        // The version before the rest: a newer program may have other fields.
        match trainer.get("format").and_then(Value::as_u64) {
            Some(format) if format > u64::from(FORMAT) => {
                let version = trainer.get("version").and_then(Value::as_str).unwrap_or("?").to_owned();
                return Err(TrainError::NewerCheckpoint { path, version });
            }
            Some(_) => {}
            None => return Err(damaged(format!("{TRAINER} has no format"))),
        }
        let progress: Progress = serde_json::from_value(trainer).map_err(|e| damaged(format!("{TRAINER}: {e}")))?;
        if let Some(field) = difference("", &read(CONFIG)?, network) {
            return Err(TrainError::OtherNetwork { path, field });
        }
        let (model, state) = (TensorFile::open(&path.join(MODEL))?, TensorFile::open(&path.join(STATE))?);
        for (name, file) in [(MODEL, &model), (STATE, &state)] {
            let step = file.metadata().get("step").map_or("?", String::as_str);
            if step != progress.step.to_string() {
                return Err(damaged(format!("{name} is of step {step} and {TRAINER} of step {}", progress.step)));
            }
        }
        Ok(Some(Self { prefix: prefix(network).to_owned(), progress, model, state, path }))
    }

    /// How far the run had come.
    #[must_use]
    pub const fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The folder, which opens as a checkpoint of the network.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives weights, moments and average to a step.
    ///
    /// # Errors
    /// A tensor that the checkpoint lacks or has in another shape; numbers that the step does not take.
    pub fn restore(&self, step: &mut dyn Step, averaged: bool) -> Result<(), TrainError> {
        let had_average = self.state.tensors().any(|(name, _)| name.starts_with("weights."));
        let layout = step.layout().clone();
        let average = averaged.then_some(Part::Average);
        for part in [Part::Weights, Part::First, Part::Second].into_iter().chain(average) {
            for (arena, place) in layout.arenas.iter().enumerate() {
                let mut numbers = vec![0.0; place.range.len()];
                for slot in layout.of_arena(arena) {
                    // A tensor that was frozen until now lies in the model alone.
                    let of_state = |label: &str| {
                        let name = format!("{label}{}", slot.name);
                        self.state.info(&name).is_some().then_some((&self.state, name))
                    };
                    let of_model = || Some((&self.model, format!("{}{}", self.prefix, slot.name)));
                    let from = match part {
                        Part::Weights if had_average => of_state("weights.").or_else(of_model),
                        Part::Weights | Part::Average => of_model(),
                        Part::First => of_state("first."),
                        Part::Second => of_state("second."),
                    };
                    let Some((file, name)) = from else { continue };
                    let tensor = file.tensor(&name)?;
                    if tensor.shape != slot.shape {
                        let reason = format!("{name} is {:?}, where the network has {:?}", tensor.shape, slot.shape);
                        return Err(TrainError::BadCheckpoint { path: self.path.clone(), reason });
                    }
                    numbers[layout.in_arena(slot)].copy_from_slice(&tensor.as_f32());
                    file.release(&name);
                }
                step.write(part, arena, &numbers).map_err(TrainError::Step)?;
            }
        }
        Ok(())
    }
}

/// The first field in which two configurations differ, with both values.
fn difference(at: &str, found: &Value, wanted: &Value) -> Option<String> {
    match (found, wanted) {
        (Value::Object(a), Value::Object(b)) => {
            let names: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            names.into_iter().find_map(|name| {
                let full = if at.is_empty() { name.clone() } else { format!("{at}.{name}") };
                difference(&full, a.get(name).unwrap_or(&Value::Null), b.get(name).unwrap_or(&Value::Null))
            })
        }
        // 10 and 10.0 are one number.
        (Value::Number(a), Value::Number(b)) if a.as_f64() == b.as_f64() => None,
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().find_map(|(i, (a, b))| difference(&format!("{at}[{i}]"), a, b))
        }
        (a, b) if a == b => None,
        (a, b) => Some(format!("{at} is {a} there and {b} here")),
    }
}

/// The top-level settings in which a run differs from the one that wrote its checkpoint.
#[must_use]
pub fn changed_settings(before: &Value, now: &Value) -> Vec<String> {
    let (Value::Object(before), Value::Object(now)) = (before, now) else { return Vec::new() };
    let names: std::collections::BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    let of = |map: &serde_json::Map<String, Value>, name: &String| map.get(name).cloned().unwrap_or_default();
    names.into_iter().filter_map(|name| difference(name, &of(before, name), &of(now, name))).collect()
}
