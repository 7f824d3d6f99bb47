//! `omnix reconstruct`: pictures and videos in, a folder of results out.
//!
//! Everything that can be wrong is looked for before work begins, in this order: inputs, weights, sizes, device, memory,
//! output folder; then every picture is decoded, and only then does the network run. Results go out image by image; however
//! a run ends, the exports of what was finished are completed and `manifest.json` says how far it came. Motion comes last:
//! when it begins, everything about geometry has been written.

mod geometry;
mod manifest;
mod motion;
mod state;
mod windows;

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use omnix::io::output::OutputFolder;
use omnix::io::output::manifest::path_text;
use omnix::io::preprocess::normalise;
use omnix::io::{Export, SinkOptions, open_sinks, write_manifest};
use omnix::{DeviceInfo, Engine, Event, FieldPlace, OmnixError, RunPlan, Session, Tier};
use serde_json::{Map, Value, json};

use crate::args::{OutArgs, RunArgs};
use crate::error::CliError;
use crate::job::{self, Job};
use crate::ui::Ui;
use crate::{bytes, disk, folder, memory, stop, text, threads};
use state::Run;

/// Arguments of `omnix reconstruct`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct ReconstructArgs {
    /// Pictures (png, jpg, webp, bmp; not heic, avif or tiff), folders of pictures (one video for each sub-folder), patterns
    /// such as 'a/*.jpg', and videos. Each is a video with its own frame times; all are reconstructed together.
    #[arg(value_name = "INPUT", required = true)]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

/// Runs from the inputs to the manifest.
pub(crate) fn run(args: &ReconstructArgs, ui: &mut Ui) -> Result<(), CliError> {
    let since = Instant::now();
    stop::keep_results();
    let mut job = Job::new(&args.inputs, &args.run, ui)?;
    if let Some(note) = folder::check(&args.out.out, &job.input)? {
        ui.note(&format!("note: {note}"));
    }
    // The weights are verified, which gives the digest for the manifest too, while the driver starts and processors are idle.
    // Without a thread that is done when the session is made.
    let weights = job.weights.clone();
    let verify = move || {
        weights.checkpoint().verify(&mut |_, _| stop::flow());
    };
    if !threads::alone() {
        let _ = std::thread::Builder::new().name("verify".to_owned()).spawn(verify);
    }
    let engine = args.run.device.open()?;
    let info = engine.info();
    let cpu = engine.gpu().device.adapter_info().device_type == omnix::wgpu::DeviceType::Cpu;
    // A field that does not fit the budget goes beside the results: that disk is known to have room.
    job.request.field = FieldPlace::AutoIn(args.out.out.clone());
    let plan = job.plan(&args.run, engine.caps(), cpu, ui)?;
    job.check_pictures(memory::for_pictures(&args.run, engine.caps().tier, true))?;
    job.check_work(&plan, &args.run, engine.caps().tier)?;
    if cpu {
        disk::check_device_memory(&plan)?;
    }
    let software = engine.why_software(args.run.device.device.as_deref());
    announce(&job, &plan, args, &info, engine.caps().tier, software.as_deref(), ui)?;
    let options = sink_options(&args.run, plan.unit());
    let folder = OutputFolder::open(&args.out.out)?;
    let sinks = open_sinks(&job.exports, &args.out.out, &options)?;
    disk::check(&args.out.out, disk::wanted(&job.exports, &job.size(&args.run, &plan), &plan, job.window))?;
    let mut run = Run {
        job: &job,
        inputs: &args.inputs,
        dir: &args.out.out,
        folder,
        begun: false,
        earlier: Vec::new(),
        args: &args.run,
        info,
        planned: plan.peak_bytes(),
        sinks,
        finished: 0,
        cameras: Vec::new(),
        files: Vec::new(),
        windows: Value::Null,
        computing: None,
        motion: Value::Null,
        timings: Map::new(),
    };
    let outcome = match job.window {
        Some(size) => run.film(&engine, size, &options, ui),
        None => run.work(&engine, plan, &options.unit, ui),
    };
    ui.end();
    run.timings.insert("total".to_owned(), json!(since.elapsed().as_secs_f64()));
    let written = run.finish(outcome.is_err(), &options.unit);
    let (finished, images, dir) = (run.finished, job.request.images, args.out.out.clone());
    // A failure of the run says more than one of completing its files.
    match outcome {
        Err(CliError::Omnix(OmnixError::Interrupted)) => {
            written?;
            return Err(if let Some((done, windows)) = run.computing {
                CliError::WindowsInterrupted { done, windows, dir }
            } else if finished < images {
                CliError::Interrupted { finished, images, dir }
            } else {
                CliError::MotionInterrupted { images, dir }
            });
        }
        Err(error) => return Err(error),
        Ok(()) => {}
    }
    let written = written?;
    run.folder.remove_windows();
    report(&run, &written, since, ui);
    Ok(())
}

/// Tells what is about to happen.
fn announce(
    job: &Job,
    plan: &RunPlan,
    args: &ReconstructArgs,
    info: &DeviceInfo,
    tier: Tier,
    software: Option<&str>,
    ui: &mut Ui,
) -> Result<(), CliError> {
    let (size, reading) = (job.size(&args.run, plan), job.reading_bytes());
    let windows = job.windows()?;
    let mut planned = job::plan_event(plan, &job.weights, &job.exports, &size, tier, job.request.budget, reading);
    planned["windows"] = job.windows_event()?;
    ui.event("plan", planned);
    let mut device = serde_json::to_value(info).unwrap_or_default();
    device["software"] = json!(software);
    ui.event("device", device);
    let software = software.map_or_else(String::new, |why| format!(", a software device: {why}"));
    ui.detail(&job::describe(plan));
    let network = &job.weights.network().config().name;
    let in_windows = job.window.map_or_else(String::new, |size| {
        format!(" in {windows} windows of {} that share {}", size.images, size.overlap)
    });
    ui.say(&format!(
        "{} image(s) of {}x{}{in_windows}, {network} with {} weights on {} ({}{software}), {} of memory, {:.1} GFLOP",
        job.request.images,
        job.request.width,
        job.request.height,
        job::storage_name(&args.run),
        info.name,
        info.backend,
        bytes::show(plan.peak_bytes()),
        plan.flops() as f64 * windows as f64 / 1e9,
    ));
    if let Some(surplus) = first(&job.weights.report().surplus) {
        ui.note(&format!("note: the checkpoint holds tensors that are not used: {surplus}"));
    }
    Ok(())
}

/// The first few of a long list, on one line.
fn first(names: &[String]) -> Option<String> {
    const SHOWN: usize = 5;
    let more = names.len().checked_sub(SHOWN).filter(|n| *n > 0).map_or_else(String::new, |n| format!(" and {n} more"));
    (!names.is_empty()).then(|| format!("{}{more}", names[..names.len().min(SHOWN)].join(", ")))
}

fn sink_options(args: &RunArgs, unit: &str) -> SinkOptions {
    let default = SinkOptions::default();
    let points = args.points.map(|n| n as usize);
    let (percentile, most) = (default.glb_confidence_percentile, default.glb_max_points);
    default
        .unit(unit.to_owned())
        .ply_confidence_percentile(args.conf_percentile)
        .ply_max_points(points)
        .glb_confidence_percentile(args.conf_percentile.unwrap_or(percentile))
        .glb_max_points(points.unwrap_or(most))
}

impl Run<'_> {
    /// Decodes, uploads, runs, feeds the sinks, and exports what moves.
    fn work(&mut self, engine: &Engine, plan: RunPlan, unit: &str, ui: &mut Ui) -> Result<(), CliError> {
        let pictures = self.read(None, ui)?;
        // Until now the folder held the results of an earlier run.
        self.folder.begin()?;
        self.begun = true;
        let request = &self.job.request;
        ui.begin("weights", "reading weights, compiling kernels");
        let mut session = Session::new(engine, &self.job.weights, plan, &mut |event| {
            if let Event::Progress(p) = event {
                ui.progress(p.done, p.total);
            }
            stop::answer()
        })?;
        let mut numbers = vec![0.0; 3 * request.height * request.width];
        for index in 0..pictures.len() {
            normalise(&pictures.get(index)?, &mut numbers);
            session.set_image(index, &numbers)?;
        }
        drop(numbers);
        self.timings.insert("weights".to_owned(), json!(ui.end()));
        let field = self.network(&mut session, &pictures, ui)?;
        // Its memory goes back before paths are evaluated.
        drop(session);
        match field {
            Some(field) => {
                self.close_sinks(false)?;
                self.export_motion(field, &pictures, unit, ui)
            }
            None => Ok(()),
        }
    }

    /// Completes what is open, writes the manifest, and looks whether everything is there. A run that was broken off before it
    /// had read its pictures leaves the folder as it was.
    fn finish(&mut self, broken_off: bool, unit: &str) -> Result<Vec<PathBuf>, CliError> {
        if !self.begun {
            return Ok(Vec::new());
        }
        let interrupted = broken_off || self.finished < self.job.request.images;
        let closed = self.close_sinks(interrupted);
        // A glb of what moves replaces the still one under its name.
        let mut files = std::mem::take(&mut self.files);
        let mut seen = std::collections::BTreeSet::new();
        files.reverse();
        files.retain(|file| seen.insert(file.path.clone()));
        files.reverse();
        let written: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
        self.earlier = self.folder.of_earlier_runs(&written);
        // Whatever happened to the folder, the manifest names what is there.
        let gone = self.folder.check(written.iter().map(PathBuf::as_path));
        files.retain(|file| gone.is_ok() || file.path.is_file());
        let manifest = self.manifest(files, interrupted || closed.is_err() || gone.is_err(), unit);
        let written = write_manifest(self.dir, &manifest);
        closed?;
        gone?;
        let mut files: Vec<PathBuf> = manifest.files.into_iter().map(|file| file.path).collect();
        files.push(written?);
        Ok(files)
    }
}

/// The end of a successful run.
fn report(run: &Run<'_>, files: &[PathBuf], since: Instant, ui: &mut Ui) {
    let dir = run.dir;
    let seconds = since.elapsed().as_secs_f64();
    let note = run.job.weights.note();
    if let Some(earlier) = run.earlier_note() {
        ui.note(&format!("note: {earlier}"));
    }
    ui.event(
        "done",
        json!({
            "dir": path_text(dir), "files": files.iter().map(|f| path_text(f)).collect::<Vec<_>>(),
            "manifest": path_text(&dir.join("manifest.json")), "images": run.finished,
            "interrupted": false, "timings_s": run.timings, "note": note,
        }),
    );
    // Hundreds of pictures are one line.
    let many = Export::folders_of_many();
    let mut shown: Vec<String> = Vec::new();
    for file in files {
        let inside = file.strip_prefix(dir).unwrap_or(file);
        let folder = inside.parent().filter(|p| many.contains(p));
        let line = folder.map_or_else(|| file.display().to_string(), |f| dir.join(f).join("").display().to_string());
        if !shown.contains(&line) {
            shown.push(line);
        }
    }
    ui.say(&format!("{} image(s) in {seconds:.1} s:", run.finished));
    for line in shown {
        ui.say(&format!("  {}", text::name(&line)));
    }
    if note.is_some() {
        let name = run.job.weights.checkpoint().name();
        ui.say(&format!(
            "note: {name} is a very small network: it shows that everything works, not how well (manifest.json says more)"
        ));
    }
}
