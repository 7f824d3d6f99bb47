//! Whole networks for tools/compare, which measures several programs in turn: every line of standard input is a command in
//! JSON (`{"do": "go"}`), answered by one line of JSON. Files are shared with the other programs: a checkpoint of random
//! weights in the layout of a published one, pictures and depth as raw f32 of this machine.
//!
//! `cargo bench -p omnix-benches --bench network -- --serve`; `--test` goes once through all commands with a small picture, to
//! see that they work (CI does so); without either it says so and ends.

mod checkpoint;

use std::io::{BufRead as _, Write as _};
use std::path::{Path, PathBuf};

use omnix::bench::RandomWeights;
use omnix::model::config::NetworkConfig;
use omnix::{Engine, Event, Request, RunPlan, Session, WeightType, Weights, quiet};
use omnix_kernels::bench::Clock;
use serde::Deserialize;
use serde_json::{Value, json};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// What can be asked.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "lowercase")]
enum Command {
    /// Write a checkpoint of random weights into a folder.
    Checkpoint { network: String, dir: PathBuf },
    /// Write seeded noise, scaled as normalised pictures are: f32 `[count, 3, height, width]`.
    Pictures { file: PathBuf, count: usize, height: usize, width: usize },
    /// Make a network ready and run it once.
    Prepare { weights: PathBuf, pictures: PathBuf, count: usize, height: usize, width: usize, f16: bool },
    /// Run it again: pictures in host memory to depth on the device.
    Go,
    /// Run it again and write every image's depth.
    Depth { file: PathBuf },
}

/// A network made ready.
struct Ready {
    session: Session,
    pictures: Vec<f32>,
    count: usize,
}

fn main() -> Outcome<()> {
    let mut out = std::io::stdout();
    let asked = |option: &str| std::env::args().any(|argument| argument == option);
    if !asked("--serve") && !asked("--test") {
        writeln!(out, "this takes commands of tools/compare: run that, or say --serve, or --test")?;
        return Ok(());
    }
    let engine = Engine::open(std::env::var("OMNIX_DEVICE").ok().as_deref())?;
    if asked("--test") {
        return every_command(&engine);
    }
    let mut ready = None;
    for line in std::io::stdin().lock().lines() {
        let answer = serde_json::from_str(&line?).map_err(Into::into).and_then(|c| answer(&engine, c, &mut ready));
        writeln!(out, "{}", answer.unwrap_or_else(|error| json!({ "error": error.to_string() })))?;
        out.flush()?;
    }
    Ok(())
}

/// Goes once through all commands, as tools/compare does, with one picture of 56×42.
fn every_command(engine: &Engine) -> Outcome<()> {
    let folder = tempfile::tempdir()?;
    let (weights, pictures, depth) =
        (folder.path().join("weights"), folder.path().join("pictures"), folder.path().join("depth"));
    let (count, height, width) = (1, 42, 56);
    let commands = [
        Command::Checkpoint { network: "da3-small".to_owned(), dir: weights.clone() },
        Command::Pictures { file: pictures.clone(), count, height, width },
        Command::Prepare { weights, pictures, count, height, width, f16: false },
        Command::Go,
        Command::Depth { file: depth.clone() },
    ];
    let mut ready = None;
    for command in commands {
        let answer = answer(engine, command, &mut ready)?;
        writeln!(std::io::stdout(), "{answer}")?;
    }
    let depth = numbers(&depth)?;
    if depth.len() != count * height * width || !depth.iter().all(|depth| depth.is_finite()) {
        return Err(format!("{} depths for {count} of {height}×{width}, or one is NaN or infinite", depth.len()).into());
    }
    Ok(())
}

fn answer(engine: &Engine, command: Command, ready: &mut Option<Ready>) -> Outcome<Value> {
    match command {
        Command::Checkpoint { network, dir } => {
            let config = match network.as_str() {
                "da3-small" => NetworkConfig::small(),
                "da3-base" => NetworkConfig::base(),
                "da3-large" => NetworkConfig::large(),
                other => return Err(format!("no network {other}: da3-small, da3-base, da3-large").into()),
            };
            checkpoint::write(&dir, &config, &RandomWeights::new(&config))?;
            Ok(json!({}))
        }
        Command::Pictures { file, count, height, width } => {
            let numbers = omnix_benches::numbers(count * 3 * height * width);
            std::fs::write(file, bytemuck::cast_slice(&numbers))?;
            Ok(json!({}))
        }
        Command::Prepare { weights, pictures, count, height, width, f16 } => {
            // The memory of the one before goes first.
            *ready = None;
            let clock = Clock::start();
            let weights = Weights::open(&weights)?;
            let storage = if f16 { WeightType::F16 } else { WeightType::F32 };
            let request = Request::new(count, height, width).storage(storage);
            let plan = RunPlan::new(&weights, &request, engine.caps())?;
            let (flops, peak) = (plan.flops(), plan.peak_bytes());
            let session = Session::new(engine, &weights, plan, &mut quiet())?;
            let made = ready.insert(Ready { session, pictures: numbers(&pictures)?, count });
            made.run(None)?;
            Ok(json!({ "first": clock.seconds().0, "flops": flops, "peak_bytes": peak, "device": engine.info() }))
        }
        Command::Go => {
            let ready = ready.as_mut().ok_or("prepare first")?;
            let clock = Clock::start();
            ready.run(None)?;
            let (wall, quiet) = clock.seconds();
            Ok(json!({ "wall": wall, "quiet": quiet }))
        }
        Command::Depth { file } => {
            ready.as_mut().ok_or("prepare first")?.run(Some(&file))?;
            Ok(json!({}))
        }
    }
}

impl Ready {
    /// Pictures in, depth on the device or, for comparison, in `file`.
    fn run(&mut self, file: Option<&Path>) -> Outcome<()> {
        let size = self.pictures.len() / self.count;
        for (index, picture) in self.pictures.chunks_exact(size).take(self.count).enumerate() {
            self.session.set_image(index, picture)?;
        }
        let Some(file) = file else {
            self.session.run_resident(&mut quiet())?;
            return Ok(());
        };
        let mut depth = Vec::new();
        self.session.run(&mut |event| {
            if let Event::Frame(frame) = event {
                depth.extend(frame.depth);
            }
            Ok(())
        })?;
        Ok(std::fs::write(file, bytemuck::cast_slice(&depth))?)
    }
}

/// A file of f32.
fn numbers(file: &Path) -> Outcome<Vec<f32>> {
    Ok(bytemuck::pod_collect_to_vec(&std::fs::read(file)?))
}
