//! A run before it has a device: frames listed, weights checked, sizes known; then planned for a device's facts.

use std::time::{Duration, Instant};

use omnix::graph::GraphError;
use omnix::io::{Export, FrameChoice, InputPlan, probe};
use omnix::{Caps, OmnixError, Request, RunPlan, Tier, Weights};
use serde_json::{Value, json};

use crate::args::{Cameras, RunArgs, WeightsType};
use crate::bytes;
use crate::error::CliError;
use crate::prepare::Preparation;
use crate::ui::Ui;

/// What is asked, as far as files tell.
pub(crate) struct Job {
    pub(crate) input: InputPlan,
    pub(crate) weights: Weights,
    pub(crate) preparation: Preparation,
    pub(crate) request: Request,
}

/// Searching for the number of frames that fit takes no longer.
const SEARCH: Duration = Duration::from_secs(2);
/// Hours of work beyond which it wants to be asked for by number.
const HOURS: f64 = 1.0;

impl Job {
    /// Lists frames, opens weights, finds sizes. Nothing is decoded.
    pub(crate) fn new(inputs: &[String], args: &RunArgs, ui: &mut Ui) -> Result<Self, CliError> {
        let input = probe(inputs, choice(args))?;
        let weights = Weights::find(&args.weights)?;
        for note in &input.notes {
            ui.note(note);
        }
        let preparation = Preparation::new(&weights, args, &input)?;
        let (width, height) = preparation.size();
        let mut request = request(args, input.frames.len(), width, height);
        request.times = input.frames.iter().map(|f| (f.video, f.frame)).collect();
        Ok(Self { input, weights, preparation, request })
    }

    /// Plans within the budget; says what would fit if this does not.
    pub(crate) fn plan(&mut self, args: &RunArgs, caps: &Caps, cpu: bool) -> Result<RunPlan, CliError> {
        self.request.budget = budget(args, cpu, self.picture_bytes())?;
        match RunPlan::new(&self.weights, &self.request, caps) {
            Ok(plan) => Ok(plan),
            Err(source @ (OmnixError::Budget { .. } | OmnixError::Graph(GraphError::TensorTooLarge { .. }))) => {
                let found = largest(&self.weights, &self.request, caps);
                let most = self.input.sources.len();
                let suggestion = match found {
                    Some(n) if n < self.request.images && n >= most => {
                        let each = if most > 1 { format!(" of each of the {most} inputs") } else { String::new() };
                        format!("; --frames {}{each} would fit", n / most)
                    }
                    _ => String::new(),
                };
                Err(CliError::TooLarge { source, suggestion })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Refuses hours of work that nobody asked for by number, such as a folder of ten thousand pictures named whole.
    pub(crate) fn check_work(&self, plan: &RunPlan, args: &RunArgs, tier: Tier) -> Result<(), CliError> {
        let hours = seconds(plan.flops(), tier) / 3600.0;
        if hours > HOURS && args.frames.is_none() && args.fps.is_none() {
            let tera_flops = plan.flops() as f64 / 1e12;
            return Err(CliError::TooMuch { images: self.request.images, tera_flops, hours });
        }
        Ok(())
    }

    /// Bytes of all processed pictures, kept on the host for the exports.
    pub(crate) fn picture_bytes(&self) -> u64 {
        3 * (self.request.images * self.request.height * self.request.width) as u64
    }
}

/// The request of `images` pictures under these options; one video in order.
pub(crate) fn request(args: &RunArgs, images: usize, width: u32, height: u32) -> Request {
    Request {
        reference: args.reference,
        rays: args.cameras == Cameras::Rays,
        storage: args.weights_type.into(),
        budget: args.memory_budget,
        ..Request::new(images, height as usize, width as usize)
    }
}

fn choice(args: &RunArgs) -> FrameChoice {
    match (args.frames, args.fps) {
        (Some(count), _) => FrameChoice::Count(count),
        (None, Some(rate)) => FrameChoice::Fps(rate),
        (None, None) => FrameChoice::All,
    }
}

/// What was asked for; else, where the device shares the machine's memory, 80 % of what is free, less the pictures.
fn budget(args: &RunArgs, cpu: bool, pictures: u64) -> Result<Option<u64>, CliError> {
    match (args.memory_budget, cpu) {
        (Some(bytes), _) => Ok(Some(bytes)),
        (None, true) => Ok(bytes::available_memory().map(|free| (free / 5 * 4).saturating_sub(pictures))),
        (None, false) => Ok(None),
    }
}

/// The most images that fit the budget: doubling, then bisection, for at most [`SEARCH`]. None if not even one does.
fn largest(weights: &Weights, request: &Request, caps: &Caps) -> Option<usize> {
    let since = Instant::now();
    let fits = |n: usize| {
        let times = request.times.iter().take(n).copied().collect();
        RunPlan::new(weights, &Request { images: n, times, reference: None, ..request.clone() }, caps).is_ok()
    };
    if !fits(1) {
        return None;
    }
    let (mut low, mut high) = (1, 2);
    while high < request.images && fits(high) && since.elapsed() < SEARCH {
        (low, high) = (high, high * 2);
    }
    high = high.min(request.images);
    while high - low > 1 && since.elapsed() < SEARCH {
        let middle = low.midpoint(high);
        if fits(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

/// Seconds of work at a rough guess of speed: it only has to tell minutes from hours.
pub(crate) fn seconds(flops: u64, tier: Tier) -> f64 {
    let a_second = match tier {
        Tier::Software => 5e10,
        Tier::Baseline => 1e10,
        Tier::Gpu => 2e12,
    };
    flops as f64 / a_second
}

/// Facts of a plan for people: one line each.
pub(crate) fn describe(plan: &RunPlan) -> String {
    let s = plan.summary();
    let [height, width] = s.image_size;
    let chunks = match s.chunk_rows.as_slice() {
        [] => "whole".to_owned(),
        rows => format!("{} part(s), chunks of {rows:?} rows", s.backbone_parts),
    };
    format!(
        "{} image(s) of {width}x{height}, {} tokens\n\
         memory  {} at most: weights {}, network {}, heads {}\n\
         work    {:.1} GFLOP: network {:.1}, heads {:.1}\n\
         chunks  network: {chunks}; heads: {} image(s) at a time",
        s.images,
        s.tokens,
        bytes::show(s.peak_bytes),
        bytes::show(s.weight_bytes),
        bytes::show(s.backbone_bytes),
        bytes::show(s.head_bytes),
        (s.backbone_flops + s.head_flops) as f64 / 1e9,
        s.backbone_flops as f64 / 1e9,
        s.head_flops as f64 / 1e9,
        s.head_images,
    )
}

/// The same for machines, with names of the outputs.
pub(crate) fn plan_event(plan: &RunPlan, weights: &Weights, exports: &[Export], budget: Option<u64>) -> Value {
    let mut event = serde_json::to_value(plan.summary()).unwrap_or_default();
    if let Value::Object(fields) = &mut event {
        fields.insert("budget_bytes".to_owned(), json!(budget));
        fields.insert("network".to_owned(), json!(weights.network().config().name));
        fields.insert("weights".to_owned(), json!(weights.checkpoint().name()));
        fields.insert("outputs".to_owned(), json!(files_of(exports, plan.request.images)));
    }
    event
}

/// Names of the files that a run leaves.
pub(crate) fn files_of(exports: &[Export], images: usize) -> Vec<String> {
    let last = images.saturating_sub(1);
    let mut files = Vec::new();
    for export in exports {
        match export {
            Export::Npz => files.push("exports/npz/results.npz".to_owned()),
            Export::MiniNpz => files.push("exports/mini_npz/results.npz".to_owned()),
            Export::Depth => files.extend([
                format!("depth/000000.png to depth/{last:06}.png"),
                format!("depth_color/000000.png to depth_color/{last:06}.png"),
                "depth/depth.json".to_owned(),
            ]),
            Export::Ply => files.push("points.ply".to_owned()),
            Export::Glb => files.push("scene.glb".to_owned()),
            Export::Tum => files.extend(["trajectory.tum".to_owned(), "frame_times.csv".to_owned()]),
            other => files.push(other.to_string()),
        }
    }
    files.push("manifest.json".to_owned());
    files
}

/// Name of the storage type for the manifest.
pub(crate) fn storage_name(args: &RunArgs) -> &'static str {
    match args.weights_type {
        WeightsType::F32 => "f32",
        WeightsType::F16 => "f16",
        WeightsType::I8 => "i8",
    }
}
