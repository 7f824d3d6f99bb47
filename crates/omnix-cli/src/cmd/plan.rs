//! `omnix plan`: what a run would take. Needs no device.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use omnix::{Caps, RunPlan, Tier, Weights};
use serde_json::{Value, json};

use super::train;
use crate::args::RunArgs;
use crate::bytes;
use crate::error::CliError;
use crate::job::{self, Job};
use crate::memory;
use crate::ui::{self, Ui};
use crate::windowing::{self, WindowSize};

/// Arguments of `omnix plan`.
#[derive(Debug, Args)]
pub(crate) struct PlanArgs {
    /// Pictures, folders, patterns and videos, as for `reconstruct`.
    #[arg(value_name = "INPUT", required_unless_present_any = ["images", "train"])]
    inputs: Vec<PathBuf>,
    /// Plan for N pictures of --size instead of files.
    #[arg(
        long, value_name = "N", requires = "size", conflicts_with = "inputs", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u32).range(1..=MOST_IMAGES)
    )]
    images: Option<u32>,
    /// Plan a step of the training that this configuration describes.
    // What is said of pictures and results has no meaning for it; the device and the budget have.
    #[arg(long, value_name = "CONFIG.toml", conflicts_with_all = [
        "inputs", "images", "frames", "fps", "every", "start", "end", "strict", "window", "overlap", "weights", "weights_type", "reference", "cameras",
        "process_res", "process_res_method", "size", "export", "points", "conf_percentile", "all_tracks", "field_type",
    ])]
    train: Option<PathBuf>,
    /// Plan for this kind of device; with --device for that very device.
    #[arg(long, value_name = "CLASS", default_value = "lavapipe", conflicts_with_all = ["device", "experimental"], help_heading = "Device")]
    device_class: DeviceClass,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

/// More images than any run has.
const MOST_IMAGES: i64 = 1 << 20;

/// Kinds of devices to plan for.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum DeviceClass {
    /// Mesa's software device.
    Lavapipe,
    /// What every WebGPU device has.
    Baseline,
    /// A GPU with WebGPU's limits.
    Gpu,
}

impl DeviceClass {
    fn caps(self) -> Caps {
        match self {
            Self::Lavapipe => Caps::lavapipe(),
            Self::Baseline => Caps::baseline(),
            Self::Gpu => Caps::baseline().with_tier(Tier::Gpu),
        }
    }
}

/// Prints the plan.
pub(crate) fn run(args: &PlanArgs, ui: &mut Ui) -> Result<(), CliError> {
    let caps = if args.run.device.device.is_some() || args.run.device.experimental {
        args.run.device.open()?.caps().clone()
    } else {
        args.device_class.caps()
    };
    if let Some(config) = &args.train {
        return train::plan(config, &caps, args.run.memory_budget, ui);
    }
    let mut windows = Value::Null;
    let (plan, weights, exports, size, reading) =
        if let (Some(images), Some((width, height))) = (args.images, args.run.size) {
            let weights = Weights::find(&args.run.weights)?;
            let mut request = job::request(&args.run, images as usize, width, height);
            let mut exports = job::chosen_exports(&args.run, &weights, &mut request)?;
            let asked = WindowSize::asked(&args.run)?.filter(|asked| asked.images < images as usize);
            if let Some(WindowSize { images: each, overlap }) = asked {
                (exports, _) = windowing::possible(&exports, args.run.names_exports())?;
                request = request.images(each).motion(weights.network().config().trajectory.is_some());
                let count = WindowSize { images: each, overlap }.count(images as usize)?;
                windows = json!({ "images": each, "overlap": overlap, "count": count });
            }
            let plan = RunPlan::new(&weights, &request, &caps)?;
            let size = job::size(&request.images(images as usize), 1, &args.run, Some(&plan));
            let followed = asked
                .filter(|_| args.run.points.is_none())
                .map_or(size.followed, |asked| size.followed * asked.images as u64 / u64::from(images));
            let each = windows["count"].as_u64().unwrap_or(0);
            let size = size.motion(size.motion && asked.is_none()).followed(followed).windows(each);
            (plan, weights, exports, size, 0)
        } else {
            let mut job = Job::new(&args.inputs, &args.run, ui)?;
            // Only what was asked for bounds a plan; the machine's free memory is the business of a run.
            job.check_pictures(memory::for_pictures(&args.run, caps.tier, false))?;
            let reading = job.reading_bytes();
            let plan = job.plan(&args.run, &caps, false, ui)?;
            let size = job.size(&args.run, &plan);
            windows = job.windows_event()?;
            (plan, job.weights, job.exports, size, reading)
        };
    if ui.json() {
        let mut event = job::plan_event(&plan, &weights, &exports, &size, caps.tier, args.run.memory_budget, reading);
        event["windows"] = windows;
        ui.event("plan", event);
        ui.event("done", json!({}));
        return Ok(());
    }
    let network = &weights.network().config().name;
    let files = job::files_of(&exports, &size).join(", ");
    let count = windows["count"].as_u64().unwrap_or(1);
    let guess = job::guess(plan.flops().saturating_mul(count), caps.tier);
    let each = if windows.is_null() { String::new() } else { format!("{count} windows, each:\n") };
    let process = memory::process(&plan, &exports, &size, caps.tier, reading).map_or_else(String::new, |bytes| {
        let bytes = bytes::show(bytes);
        format!("process about {bytes} on a software device: that memory, the program, the driver and the files\n")
    });
    ui::print(&format!(
        "network {network}, {} weights, for a {} device\n{each}{}\n{process}time    about {guess}, a rough guess\nfiles   {files}",
        job::storage_name(&args.run),
        caps.tier,
        job::describe(&plan),
    ))
}
