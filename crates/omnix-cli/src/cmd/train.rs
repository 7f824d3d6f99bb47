//! `omnix train`: a network from a configuration, data and a device, until a number of steps is done.

use std::path::{Path, PathBuf};

use clap::Args;
use omnix::Caps;
use omnix_train::config::{Recipe, SampleConfig};
use omnix_train::device::{StepPlan, Takes, planned, planned_among, planned_least, ready_among};
use omnix_train::peers::Peers;
use omnix_train::{Event, LossValues, RunOptions, Session, read_config};
use serde_json::{Map, Value, json};

use crate::args::DeviceArgs;
use crate::bytes;
use crate::error::CliError;
use crate::job;
use crate::stop;
use crate::ui::{self, Ui};

/// Arguments of `omnix train`.
#[derive(Debug, Args)]
pub(crate) struct TrainArgs {
    /// The configuration, such as recipes/smoke.toml, where every key is explained.
    #[arg(value_name = "CONFIG.toml")]
    config: PathBuf,
    /// Where checkpoints, figures and curves go. A run goes on from the checkpoint that it finds there.
    #[arg(long, value_name = "DIR", default_value = "out/train")]
    out: PathBuf,
    /// Steps in all, those of a checkpoint included. [default: the configuration's]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Seed of start values and of the order of data. [default: the configuration's]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Device memory that a step may take, such as 4GiB. [default: the configuration's, else no bound]
    ///
    /// Where it is too little to keep what the gradient needs of the forward pass, some of that is computed again: the same numbers for
    /// less memory and more operations.
    #[arg(long, value_name = "SIZE", value_parser = bytes::parse)]
    memory_budget: Option<u64>,
    /// Train with the other processes that `mpirun` or `srun` has started with this one, each on samples of its own.
    ///
    /// All of them see the same --out folder; the first one validates, reports and writes.
    #[arg(long)]
    mpi: bool,
    #[command(flatten)]
    device: DeviceArgs,
    /// One JSON object a line on standard output, nothing for people.
    ///
    /// Its `event` is one of: note {message}; plan {images, image_size, bytes, flops, forward_flops, recomputed_flops, without {bytes,
    /// flops}, trained}, where `without` is what a step would take if nothing were computed again; device {..}; continued {step};
    /// step {step, of, losses, norm, rates, seconds, left_s}; validated {step, losses, figures, best}, with the columns of `omnix eval
    /// network` as figures; saved {step}; save_failed {message}; trained {step, stopped, best}; error {..}.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Trains.
pub(crate) fn run(args: &TrainArgs, ui: &mut Ui) -> Result<(), CliError> {
    if !args.mpi {
        return train(args, None, ui);
    }
    among_peers(args, ui)
}

/// Trains in one of several processes. The first one speaks for all.
#[cfg(feature = "mpi")]
fn among_peers(args: &TrainArgs, ui: &mut Ui) -> Result<(), CliError> {
    use omnix_train::peers::{Mpi, Peers as _};
    let peers = Mpi::begin()?;
    // What goes wrong in another one it says for itself, to people.
    let mut quiet = Ui::new(false, true, false);
    let ui = if peers.rank() == 0 { ui } else { &mut quiet };
    match train(args, Some(&peers), ui) {
        // The others may wait for this one: MPI ends them.
        Err(CliError::TrainingInterrupted { .. }) if peers.rank() > 0 => Ok(()),
        Err(error) if !matches!(error, CliError::TrainingInterrupted { .. }) => {
            ui.error(&error);
            peers.abort(error.exit_code().into())
        }
        trained => trained,
    }
}

#[cfg(not(feature = "mpi"))]
fn among_peers(_: &TrainArgs, _: &mut Ui) -> Result<(), CliError> {
    let cure =
        "build it with `cargo build --release -p omnix-cli --features mpi` (tools/check-mpi installs what that needs)";
    Err(CliError::Usage(format!("this program was built without MPI: {cure}")))
}

fn train(args: &TrainArgs, peers: Option<&dyn Peers>, ui: &mut Ui) -> Result<(), CliError> {
    let mut recipe = read_config(&args.config)?;
    if let Some(seed) = args.seed {
        recipe.config.seed = seed;
    }
    let until = args.steps.unwrap_or(recipe.config.steps);
    let engine = args.device.open()?;
    let processes = peers.map_or(1, Peers::count);
    let plan = planned_among(&recipe, engine.caps(), args.memory_budget, processes)?;
    let Takes { bytes, flops } = plan.takes;
    ui.event("plan", plan_event(&plan, &recipe));
    let info = engine.info();
    ui.event("device", serde_json::to_value(&info).unwrap_or_default());
    ui.say(&format!(
        "{}: {:.2} M numbers are trained; a step takes {} and {:.1} GFLOP on {}",
        recipe.network.name,
        plan.trained() as f64 / 1e6,
        bytes::show(bytes),
        giga(flops),
        info.name
    ));
    if plan.recomputed() > 0 {
        ui.say(&format!(
            "to fit the memory budget, {:.1} GFLOP of a step ({}) are computed again; without, it would take {}",
            giga(plan.recomputed()),
            more(&plan),
            bytes::show(plan.without.bytes)
        ));
    }
    drop(plan);
    stop::keep_results();
    let mut session = match peers {
        None => Session::open(recipe, &args.out)?,
        Some(peers) => Session::join(recipe, &args.out, peers)?,
    };
    if processes > 1 {
        ui.say(&format!("{processes} processes train together"));
    }
    let mut step = ready_among(&session, engine.gpu(), args.memory_budget, processes)?;
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get().div_ceil(2));
    let options = RunOptions::new(until, stop::flag()).threads(threads).peers(peers);
    let outcome = omnix_train::run(&mut session, &mut step, options, &mut |event| tell(event, ui))?;
    let best = outcome.best.as_ref().map(|best| json!({ "step": best.step, "loss": best.figure }));
    ui.event("trained", json!({ "step": outcome.step, "stopped": outcome.stopped, "best": best }));
    let done = if outcome.stopped { "stopped after" } else { "done:" };
    ui.say(&format!("{done} step {} in {}", outcome.step, args.out.display()));
    if outcome.stopped {
        Err(CliError::TrainingInterrupted { step: outcome.step, out: args.out.clone() })
    } else {
        Ok(())
    }
}

/// What a step of a training would take, on standard output. Needs no device.
pub(crate) fn plan(config: &Path, caps: &Caps, budget: Option<u64>, ui: &mut Ui) -> Result<(), CliError> {
    let recipe = read_config(config)?;
    let plan = planned(&recipe, caps, budget)?;
    // Where nothing bounds the memory, also the least that will do.
    let bounded = budget.is_some() || recipe.config.memory_budget.is_some();
    let least = if bounded { None } else { Some(planned_least(&recipe, caps)?) };
    if ui.json() {
        let mut event = plan_event(&plan, &recipe);
        event["least"] = json!(least.map(|least| takes(least.takes)));
        ui.event("plan", event);
        ui.event("done", json!({}));
        return Ok(());
    }
    let SampleConfig { images, size: [width, height], .. } = recipe.config.sample;
    let samples = recipe.config.optimiser.accumulate;
    let Takes { bytes, flops } = plan.takes;
    let (mut memory, mut work) = (String::new(), String::new());
    if plan.recomputed() > 0 {
        memory = format!(", {} if nothing were computed again", bytes::show(plan.without.bytes));
        work = format!(" and {:.1} computed again ({})", giga(plan.recomputed()), more(&plan));
    }
    let least = least.map_or_else(String::new, |least| {
        let (bytes, again) = (bytes::show(least.takes.bytes), giga(least.recomputed()));
        format!("\nleast   {bytes}, with {again:.1} GFLOP computed again ({})", more(&least))
    });
    ui::print(&format!(
        "training of network {}, for a {} device\n{images} image(s) of {width}x{height}; {samples} sample(s) make a step\n\
         trained {:.2} M numbers\n\
         memory  {} on the device{memory}\n\
         work    {:.1} GFLOP a sample, of them {:.1} forward{work}\n\
         time    about {} a step, a rough guess{least}",
        recipe.network.name,
        caps.tier,
        plan.trained() as f64 / 1e6,
        bytes::show(bytes),
        giga(flops),
        giga(plan.forward_flops()),
        job::guess(flops.saturating_mul(samples.into()), caps.tier),
    ))
}

fn giga(flops: u64) -> f64 {
    flops as f64 / 1e9
}

/// The price of computing again, relative to all that a step would take without.
fn more(plan: &StepPlan) -> String {
    format!("+{:.1} %", 100.0 * plan.recomputed() as f64 / plan.without.flops as f64)
}

fn takes(Takes { bytes, flops }: Takes) -> Value {
    json!({ "bytes": bytes, "flops": flops })
}

/// The same for machines.
fn plan_event(plan: &StepPlan, recipe: &Recipe) -> Value {
    let config = &recipe.config;
    json!({
        "images": config.sample.images, "image_size": config.sample.size, "bytes": plan.takes.bytes, "flops": plan.takes.flops,
        "forward_flops": plan.forward_flops(), "recomputed_flops": plan.recomputed(), "without": takes(plan.without),
        "trained": plan.trained(),
    })
}

fn tell(event: &Event<'_>, ui: &mut Ui) {
    match event {
        Event::Continued { step } => {
            ui.event("continued", json!({ "step": step }));
            ui.say(&format!("going on from step {step}"));
        }
        Event::Note(text) => ui.note(text),
        Event::Step { figures, of, left } => {
            ui.event(
                "step",
                json!({
                    "step": figures.step, "of": of, "losses": losses(&figures.losses), "norm": figures.norm,
                    "rates": figures.rates, "seconds": figures.seconds, "left_s": left.as_secs_f64(),
                }),
            );
            // Every step of a short run, every tenth of a long one.
            if *of <= 100 || figures.step.is_multiple_of(10) || figures.step == *of {
                ui.say(&format!(
                    "step {}/{of}  loss {:.4}  norm {:.3}  {:.2} s  {} left",
                    figures.step,
                    figures.losses.total,
                    figures.norm,
                    figures.seconds,
                    clock(left.as_secs())
                ));
            }
        }
        Event::Validated { step, losses: found, figures, best } => {
            let named: Map<String, Value> =
                figures.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
            ui.event("validated", json!({ "step": step, "losses": losses(found), "figures": named, "best": best }));
            let best = if *best { ", the best so far" } else { "" };
            let figures: String = figures.iter().map(|(name, value)| format!("  {name} {value:.3}")).collect();
            ui.say(&format!("step {step}: validation loss {:.4}{best}{figures}", found.total));
        }
        Event::Saved { step } => ui.event("saved", json!({ "step": step })),
        Event::SaveFailed { error } => {
            ui.event("save_failed", json!({ "message": error.to_string() }));
            ui.note(&format!("the checkpoint could not be written, the former one is as it was: {error}"));
        }
        _ => {}
    }
}

fn losses(found: &LossValues) -> Value {
    let mut all: Map<String, Value> = found.terms.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    all.insert("total".to_owned(), json!(found.total));
    Value::Object(all)
}

/// Hours, minutes and seconds.
fn clock(seconds: u64) -> String {
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}
