//! `omnix reconstruct`: pictures and videos in, a folder of results out.
//!
//! Everything that can be wrong is looked for before work begins, in this order: inputs, weights, sizes, device, memory,
//! output folder; then every picture is decoded, and only then does the network run. Results go out image by image; however
//! a run ends, the exports of what was finished are completed and `manifest.json` says how far it came. Motion comes last:
//! when it begins, everything about geometry has been written.

mod manifest;
mod motion;

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use omnix::geometry::{RayMaps, cameras_from_rays, sample_table};
use omnix::io::preprocess::{exported_picture, normalise};
use omnix::io::{FrameLoader, FrameResult, Picture, RunSummary, Sink, SinkOptions, open_sinks, write_manifest};
use omnix::{Camera, DeviceInfo, Engine, Event, Field, FieldPlace, OmnixError, Phase, RunPlan, Session, Tier};
use serde_json::{Map, Value, json};

use crate::args::{OutArgs, RunArgs};
use crate::error::CliError;
use crate::job::{self, Job};
use crate::ui::Ui;
use crate::{bytes, disk, stop};

/// Arguments of `omnix reconstruct`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct ReconstructArgs {
    /// Pictures (png, jpg, webp, bmp), folders of pictures (one video for each sub-folder), patterns such as 'a/*.jpg', and
    /// videos. Each is a video with its own frame times; all are reconstructed together.
    #[arg(value_name = "INPUT", required = true)]
    inputs: Vec<String>,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

/// Where a run stands; survives its failure.
struct Run<'a> {
    job: &'a Job,
    args: &'a ReconstructArgs,
    info: DeviceInfo,
    /// Bytes on the device at most, as planned.
    planned: u64,
    sinks: Vec<Box<dyn Sink>>,
    finished: usize,
    /// What the exports show, where it is not the camera decoder's.
    cameras: Vec<Camera>,
    /// Files that were written.
    files: Vec<PathBuf>,
    /// What the manifest says of motion.
    motion: Value,
    timings: Map<String, Value>,
}

/// Runs from the inputs to the manifest.
pub(crate) fn run(args: &ReconstructArgs, ui: &mut Ui) -> Result<(), CliError> {
    let since = Instant::now();
    stop::listen();
    let mut job = Job::new(&args.inputs, &args.run, ui)?;
    // The weights are verified, which gives the digest for the manifest too, while the driver starts and processors are idle.
    // Without a thread that is done when the session is made.
    let weights = job.weights.clone();
    let verify = move || {
        weights.checkpoint().verify(&mut |_, _| stop::flow());
    };
    let _ = std::thread::Builder::new().name("verify".to_owned()).spawn(verify);
    let engine = args.run.device.open()?;
    let info = engine.info();
    let cpu = engine.gpu().device.adapter_info().device_type == omnix::wgpu::DeviceType::Cpu;
    // A field that does not fit the budget goes beside the results: that disk is known to have room.
    job.request.field = FieldPlace::AutoIn(args.out.out.clone());
    let plan = job.plan(&args.run, engine.caps(), cpu)?;
    job.check_work(&plan, &args.run, engine.caps().tier)?;
    let software = engine.why_software(args.run.device.device.as_deref());
    announce(&job, &plan, args, &info, engine.caps().tier, software.as_deref(), ui);
    let options = sink_options(&args.run);
    let sinks = open_sinks(&job.exports, &args.out.out, &options)?;
    disk::check(&args.out.out, disk::wanted(&job, &args.run, &plan))?;
    let mut run = Run {
        job: &job,
        args,
        info,
        planned: plan.peak_bytes(),
        sinks,
        finished: 0,
        cameras: Vec::new(),
        files: Vec::new(),
        motion: Value::Null,
        timings: Map::new(),
    };
    let outcome = run.work(&engine, plan, &options.unit, ui);
    ui.end();
    run.timings.insert("total".to_owned(), json!(since.elapsed().as_secs_f64()));
    let written = run.finish(outcome.is_err(), &options.unit);
    let (finished, images, dir) = (run.finished, job.request.images, args.out.out.clone());
    // A failure of the run says more than one of completing its files.
    match outcome {
        Err(CliError::Omnix(OmnixError::Interrupted)) => {
            written?;
            return Err(if finished < images {
                CliError::Interrupted { finished, images, dir }
            } else {
                CliError::MotionInterrupted { images, dir }
            });
        }
        Err(error) => return Err(error),
        Ok(()) => {}
    }
    report(&run, &written?, since, ui);
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
) {
    ui.event("plan", job::plan_event(plan, &job.weights, &job.exports, &args.run, tier, job.request.budget));
    let mut device = serde_json::to_value(info).unwrap_or_default();
    device["software"] = json!(software);
    ui.event("device", device);
    let software = software.map_or_else(String::new, |why| format!(", a software device: {why}"));
    let network = &job.weights.network().config().name;
    ui.say(&format!(
        "{} image(s) of {}x{}, {network} with {} weights on {} ({}{software}), {} of memory, {:.1} GFLOP",
        job.request.images,
        job.request.width,
        job.request.height,
        job::storage_name(&args.run),
        info.name,
        info.backend,
        bytes::show(plan.peak_bytes()),
        plan.flops() as f64 / 1e9,
    ));
    for left_out in &job.weights.network().config().left_out {
        ui.note(&format!("note: {}", left_out.note()));
    }
    if let Some(surplus) = first(&job.weights.report().surplus) {
        ui.note(&format!("note: the checkpoint holds tensors that are not used: {surplus}"));
    }
}

/// The first few of a long list, on one line.
fn first(names: &[String]) -> Option<String> {
    const SHOWN: usize = 5;
    let more = names.len().checked_sub(SHOWN).filter(|n| *n > 0).map_or_else(String::new, |n| format!(" and {n} more"));
    (!names.is_empty()).then(|| format!("{}{more}", names[..names.len().min(SHOWN)].join(", ")))
}

fn sink_options(args: &RunArgs) -> SinkOptions {
    let default = SinkOptions::default();
    let points = args.points.map(|n| n as usize);
    SinkOptions {
        ply_confidence_percentile: args.conf_percentile,
        ply_max_points: points,
        glb_confidence_percentile: args.conf_percentile.unwrap_or(default.glb_confidence_percentile),
        glb_max_points: points.unwrap_or(default.glb_max_points),
        ..default
    }
}

impl Run<'_> {
    /// Decodes, uploads, runs, feeds the sinks, and exports what moves.
    fn work(&mut self, engine: &Engine, plan: RunPlan, unit: &str, ui: &mut Ui) -> Result<(), CliError> {
        let pictures = self.read(ui)?;
        let request = &self.job.request;
        ui.begin("weights", "reading weights, compiling kernels");
        let mut session = Session::new(engine, &self.job.weights, plan, &mut |event| {
            if let Event::Progress(p) = event {
                ui.progress(p.done, p.total);
            }
            stop::answer()
        })?;
        let mut numbers = vec![0.0; 3 * request.height * request.width];
        for (index, picture) in pictures.iter().enumerate() {
            normalise(picture, &mut numbers);
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
                self.export_motion(field, pictures, unit, ui)
            }
            None => Ok(()),
        }
    }

    /// Every picture at the network's size, 8 bits a channel.
    fn read(&mut self, ui: &mut Ui) -> Result<Vec<Picture>, CliError> {
        let input = &self.job.input;
        let total = input.frames.len();
        ui.begin("read", &format!("reading {total} image(s)"));
        let mut loader = FrameLoader::new(input);
        let mut pictures = Vec::with_capacity(total);
        for index in 0..total {
            if stop::asked() {
                return Err(OmnixError::Interrupted.into());
            }
            pictures.push(self.job.preparation.apply(&loader.load(index)?)?);
            ui.progress(index as u64 + 1, total as u64);
        }
        self.timings.insert("read".to_owned(), json!(ui.end()));
        Ok(pictures)
    }

    /// The network, and each image's results into the sinks.
    fn network(&mut self, session: &mut Session, pictures: &[Picture], ui: &mut Ui) -> Result<Option<Field>, CliError> {
        let since = Instant::now();
        let request = &self.job.request;
        let (gh, gw) = request.grid();
        let rays_size = [8 * gh, 8 * gw];
        let table = request.rays.then(|| sample_table(rays_size[0] * rays_size[1]));
        let image = [request.height as u32, request.width as u32];
        let (frames, sinks, finished) = (&self.job.input.frames, &mut self.sinks, &mut self.finished);
        let (cameras, timings) = (&mut self.cameras, &mut self.timings);
        let mut phase = None;
        let mut field = None;
        let outcome = session.run(&mut |event| {
            let geometry = match event {
                Event::Progress(p) => {
                    if phase.replace(p.phase) != Some(p.phase) {
                        let (name, text) = said(p.phase);
                        begin(timings, ui, name, text);
                    }
                    ui.progress(p.done, p.total);
                    return stop::answer();
                }
                Event::Frame(geometry) => geometry,
                Event::Field(made) => {
                    field = Some(*made);
                    return Ok(());
                }
                _ => return Ok(()),
            };
            let index = geometry.index;
            let camera = match (&geometry.rays, &table) {
                (Some((rays, confidence)), Some(table)) => {
                    camera_of_rays(&RayMaps { rays, confidence, size: rays_size }, image, table)?
                }
                _ => geometry.camera,
            };
            let rgb = exported_picture(&pictures[index]);
            let frame = &frames[index];
            let result = FrameResult {
                index,
                video: frame.video,
                frame: frame.frame,
                time_s: frame.time_s,
                width: image[1],
                height: image[0],
                depth: &geometry.depth,
                confidence: Some(&geometry.confidence),
                rgb: &rgb.data,
                extrinsics: Some(camera.extrinsics),
                intrinsics: Some(camera.intrinsics),
                sky: None,
            };
            for sink in sinks.iter_mut() {
                sink.frame(&result)?;
            }
            cameras.push(camera);
            *finished = index + 1;
            let (min, max) = range(&geometry.depth);
            let fields = json!({
                "index": index, "video": frame.video, "frame": frame.frame, "time_s": frame.time_s,
                "depth_min": min, "depth_max": max, "seconds": since.elapsed().as_secs_f64(),
            });
            ui.event("frame", fields);
            Ok(())
        });
        begin(timings, ui, "", "");
        outcome?;
        Ok(field)
    }

    /// Completes the sinks' files; on failure tries all of it and returns the first error.
    fn close_sinks(&mut self, interrupted: bool) -> Result<(), CliError> {
        let mut failed = None;
        for sink in std::mem::take(&mut self.sinks) {
            match sink.finish(&RunSummary { interrupted }) {
                Ok(written) => self.files.extend(written),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        failed.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Completes what is open and writes the manifest.
    fn finish(&mut self, broken_off: bool, unit: &str) -> Result<Vec<PathBuf>, CliError> {
        let interrupted = broken_off || self.finished < self.job.request.images;
        let closed = self.close_sinks(interrupted);
        // A glb of what moves replaces the still one under its name.
        let mut files = std::mem::take(&mut self.files);
        let mut seen = std::collections::BTreeSet::new();
        files.retain(|file| seen.insert(file.clone()));
        let manifest = self.manifest(files, interrupted || closed.is_err(), unit);
        let written = write_manifest(&self.args.out.out, &manifest);
        closed?;
        let mut files = manifest.files;
        files.push(written?);
        Ok(files)
    }
}

/// What people read of a phase, and its name for machines.
fn said(phase: Phase) -> (&'static str, &'static str) {
    match phase {
        Phase::Weights => ("weights", "reading weights"),
        Phase::Backbone => ("backbone", "network over all images"),
        Phase::Head => ("head", "depth, image by image"),
        Phase::Motion => ("motion", "what moves, over all images"),
        Phase::Sampling => ("sampling", "how each pixel moves, image by image"),
        _ => ("other", "working"),
    }
}

/// Ends the phase that runs, adds its seconds to its name's, and begins `name`, unless that is empty.
fn begin(timings: &mut Map<String, Value>, ui: &mut Ui, name: &'static str, text: &str) {
    if let Some(before) = ui.phase() {
        let seconds = timings.get(before).and_then(Value::as_f64).unwrap_or(0.0) + ui.end();
        timings.insert(before.to_owned(), json!(seconds));
    }
    if !name.is_empty() {
        ui.begin(name, text);
    }
}

/// The camera of one image from its rays.
fn camera_of_rays(maps: &RayMaps<'_>, image: [u32; 2], table: &[[u32; 8]]) -> Result<Camera, OmnixError> {
    let cameras = cameras_from_rays(maps, image, Some(table))?;
    let none = || OmnixError::Request { reason: "BUG: no camera for a ray map".to_owned() };
    cameras.first().map(|c| c.camera).ok_or_else(none)
}

/// Least and greatest depth.
fn range(depth: &[f32]) -> (f32, f32) {
    depth.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(*d), b.max(*d)))
}

/// Folders with a file for every image.
const MANY: [&str; 6] = ["depth", "depth_color", "masks", "theta", "tracks", "st4rtrack"];

/// The end of a successful run.
fn report(run: &Run<'_>, files: &[PathBuf], since: Instant, ui: &mut Ui) {
    let dir = &run.args.out.out;
    let seconds = since.elapsed().as_secs_f64();
    let note = run.job.weights.note();
    ui.event(
        "done",
        json!({
            "dir": dir, "files": files, "manifest": dir.join("manifest.json"), "images": run.finished,
            "interrupted": false, "timings_s": run.timings, "note": note,
        }),
    );
    // Hundreds of pictures are one line.
    let mut shown: Vec<String> = Vec::new();
    for file in files {
        let inside = file.strip_prefix(dir).unwrap_or(file);
        let folder = inside.parent().filter(|p| MANY.iter().any(|many| p.ends_with(many)));
        let line = folder.map_or_else(|| file.display().to_string(), |f| dir.join(f).join("").display().to_string());
        if !shown.contains(&line) {
            shown.push(line);
        }
    }
    ui.say(&format!("{} image(s) in {seconds:.1} s:", run.finished));
    for line in shown {
        ui.say(&format!("  {line}"));
    }
    if let Some(note) = note {
        ui.say(&format!("note: {note}"));
    }
}
