//! `omnix weights`: `info`, `check` and `convert`.

mod convert;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use clap::{Args, Subcommand};
use omnix::checkpoint::{CheckReport, Checkpoint, WeightsError, describe, licence};
use omnix::{OmnixError, Weights};
use serde_json::{Value, json};

use crate::bytes;
use crate::error::CliError;
use crate::ui::{self, Ui};

/// What to do with a checkpoint.
#[derive(Debug, Subcommand)]
pub(crate) enum WeightsCommand {
    /// What a checkpoint holds: network, size, types, digest.
    Info(WeightsArgs),
    /// Every tensor: there, of the right shape, and nothing but numbers. Exit code 3 if not.
    Check(WeightsArgs),
    /// Writes a checkpoint anew, of PyTorch or not: as safetensors, in another type, in several files.
    Convert(convert::ConvertArgs),
}

/// Arguments of those that read.
#[derive(Debug, Args)]
pub(crate) struct WeightsArgs {
    /// A folder with config.json and model.safetensors, such a file or a PyTorch checkpoint (.pt, .pth, .ckpt), or `nano`.
    #[arg(value_name = "PATH|NAME")]
    weights: String,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

impl WeightsCommand {
    /// Whether machines listen.
    pub(crate) fn json(&self) -> bool {
        match self {
            Self::Info(args) | Self::Check(args) => args.json,
            Self::Convert(args) => args.json,
        }
    }
}

/// Runs one of them.
pub(crate) fn run(command: &WeightsCommand, ui: &mut Ui) -> Result<(), CliError> {
    match command {
        WeightsCommand::Info(args) => info(args, ui),
        WeightsCommand::Check(args) => check(args, ui),
        WeightsCommand::Convert(args) => convert::run(args, ui),
    }
}

fn info(args: &WeightsArgs, ui: &mut Ui) -> Result<(), CliError> {
    // A checkpoint that does not fit its configuration can still be looked at.
    let opened;
    let (found, problem) = match Weights::find(&args.weights) {
        Ok(weights) => (Ok(weights), None),
        Err(error @ (OmnixError::Model(_) | OmnixError::Weights(WeightsError::Mismatch { .. }))) => {
            opened = Checkpoint::open(Path::new(&args.weights)).map_err(OmnixError::from)?;
            (Err(&opened), Some(error.to_string()))
        }
        Err(error) => return Err(error.into()),
    };
    let checkpoint = match &found {
        Ok(weights) => weights.checkpoint(),
        Err(checkpoint) => checkpoint,
    };
    let mut types: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut tensors, mut numbers, mut size) = (0usize, 0usize, 0u64);
    for (_, tensor) in checkpoint.tensors() {
        *types.entry(&tensor.dtype).or_default() += 1;
        tensors += 1;
        numbers += tensor.elements();
        size += tensor.byte_len() as u64;
    }
    let network = found.as_ref().ok().map(|w| w.network().config().name.clone());
    let note = found.as_ref().ok().and_then(|w| w.note());
    let seems = describe(checkpoint);
    if ui.json() {
        let fields = json!({
            "name": checkpoint.name(), "path": checkpoint.path(), "network": network, "seems": seems, "tensors": tensors,
            "parameters": numbers, "bytes": size, "types": types, "key_prefix": checkpoint.key_prefix(),
            "digest": format!("blake3:{}", checkpoint.digest()), "metadata": checkpoint.metadata(), "usable": problem.is_none(),
            "problem": problem, "note": note, "taken_for": checkpoint.taken_for(),
            "licence": licence(checkpoint.name()),
        });
        ui.event("weights", fields);
        return Ok(());
    }
    let listed: Vec<String> = types.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let mut lines = vec![
        format!("name     {}", checkpoint.name()),
        format!("network  {}", network.as_deref().unwrap_or("none that can be run")),
        format!("seems    {seems}"),
        format!(
            "tensors  {tensors} ({}), {:.2} M parameters, {}",
            listed.join(", "),
            numbers as f64 / 1e6,
            bytes::show(size)
        ),
        format!("prefix   {}", if checkpoint.key_prefix().is_empty() { "none" } else { checkpoint.key_prefix() }),
        format!("digest   blake3:{}", checkpoint.digest()),
    ];
    lines.extend(licence(checkpoint.name()).map(|licence| format!("licence  {licence}, as published")));
    lines.extend(checkpoint.taken_for().map(|name| format!("config   none beside it; by its tensors it is {name}")));
    lines.extend(checkpoint.metadata().iter().map(|(k, v)| format!("metadata {k} = {v}")));
    lines.extend(problem.map(|p| format!("problem  {p}")));
    lines.extend(note.map(|n| format!("note     {n}")));
    ui::print(&lines.join("\n"))
}

/// The first number of a tensor that cannot be used, or not in some way.
struct Odd {
    name: String,
    index: usize,
    value: f32,
}

fn check(args: &WeightsArgs, ui: &mut Ui) -> Result<(), CliError> {
    let opened;
    let own;
    let (checkpoint, report): (&Checkpoint, &CheckReport) = match Weights::find(&args.weights) {
        Ok(weights) => {
            own = weights;
            (own.checkpoint(), own.report())
        }
        Err(OmnixError::Weights(WeightsError::Mismatch { report })) => {
            opened = (Checkpoint::open(Path::new(&args.weights)).map_err(OmnixError::from)?, report);
            (&opened.0, &opened.1)
        }
        Err(error) => return Err(error.into()),
    };
    let (damaged, large) = scan(checkpoint);
    let problems = report.missing.len() + report.wrong_shape.len() + report.unsupported.len() + damaged.len();
    if ui.json() {
        ui.event("check", as_json(report, &damaged, &large, problems));
    } else {
        ui::print(&as_text(checkpoint, report, (&damaged, &large), problems))?;
    }
    if problems > 0 {
        return Err(CliError::BadWeights { problems, path: report.path.clone() });
    }
    Ok(())
}

/// Every tensor with a NaN or infinity, and those with finite numbers that f16 cannot hold. Tensors of other types than floats
/// have neither.
fn scan(checkpoint: &Checkpoint) -> (Vec<Odd>, Vec<Odd>) {
    let (mut damaged, mut large) = (Vec::new(), Vec::new());
    let verified = checkpoint.verify(&mut |_, _| ControlFlow::Continue(()));
    for (name, found) in verified.into_iter().flat_map(|verified| verified.findings()) {
        let odd = |(index, value)| Odd { name: name.to_owned(), index, value };
        damaged.extend(found.non_finite.map(odd));
        large.extend(found.beyond_f16.map(odd));
    }
    (damaged, large)
}

fn as_json(report: &CheckReport, damaged: &[Odd], large: &[Odd], problems: usize) -> Value {
    let shapes: Vec<Value> = report
        .wrong_shape
        .iter()
        .map(|w| json!({ "name": w.name, "expected": w.expected, "found": w.found }))
        .collect();
    let listed = |odd: &[Odd]| -> Vec<Value> {
        odd.iter().map(|d| json!({ "name": d.name, "index": d.index, "value": d.value.to_string() })).collect()
    };
    json!({
        "ok": problems == 0, "problems": problems, "seems": report.seems, "path": report.path, "missing": report.missing,
        "wrong_shape": shapes, "unsupported": report.unsupported, "not_finite": listed(damaged), "beyond_f16": listed(large), "surplus": report.surplus,
        "ignored": report.ignored,
    })
}

fn as_text(
    checkpoint: &Checkpoint,
    report: &CheckReport,
    (damaged, large): (&[Odd], &[Odd]),
    problems: usize,
) -> String {
    let mut lines = vec![format!("{}: {}", checkpoint.name(), report.seems)];
    lines.extend(report.missing.iter().map(|name| format!("missing      {name}")));
    let shape = |w: &omnix::checkpoint::WrongShape| {
        format!("wrong shape  {}: {:?} instead of {:?}", w.name, w.found, w.expected)
    };
    lines.extend(report.wrong_shape.iter().map(shape));
    lines.extend(report.unsupported.iter().map(|(name, dtype)| format!("wrong type   {name}: {dtype}")));
    lines.extend(damaged.iter().map(|d| format!("not finite   {}: {} at element {}", d.name, d.value, d.index)));
    let beyond = |d: &Odd| format!("beyond f16   {}: {} at element {}; store it as f32", d.name, d.value, d.index);
    lines.extend(large.iter().map(beyond));
    lines.extend(report.surplus.iter().map(|name| format!("surplus      {name}")));
    lines.push(format!("left out     {} tensor(s) of parts that are not run", report.ignored.len()));
    let count = checkpoint.tensors().count();
    lines.push(if problems == 0 {
        format!("ok: {count} tensors")
    } else {
        format!("{problems} problem(s) in {count} tensors")
    });
    lines.join("\n")
}
