//! A run before it has a device: frames listed, weights checked, sizes known; then planned for a device's facts.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use omnix::checkpoint::licence;
use omnix::geometry::AlignTo;
use omnix::graph::GraphError;
use omnix::io::cameras::{self, MatchedCamera, match_cameras};
use omnix::io::input::is_video;
use omnix::io::{Export, FrameChoice, InputPlan, ReadOptions, RunSize, Stop, probe_with};
use omnix::windows::{Window, window_request};
use omnix::{Caps, FieldPrecision, OmnixError, Request, RunPlan, Tier, Weights};
use serde_json::{Value, json};

use crate::args::{Cameras, RunArgs, WeightsType};
use crate::bytes;
use crate::error::CliError;
use crate::masking;
use crate::memory;
use crate::prepare::Preparation;
use crate::stop;
use crate::ui::Ui;
use crate::windowing::{self, WindowSize};

/// What is asked, as far as files tell.
pub(crate) struct Job {
    pub(crate) input: InputPlan,
    pub(crate) weights: Weights,
    pub(crate) preparation: Preparation,
    pub(crate) request: Request,
    /// Each frame's known camera, if they are given.
    pub(crate) known: Option<Vec<MatchedCamera>>,
    /// What to write.
    pub(crate) exports: Vec<Export>,
    /// How the film is cut into windows, once it is planned; none where all images are one.
    pub(crate) window: Option<WindowSize>,
}

/// Searching for the number of frames that fit takes no longer.
const SEARCH: Duration = Duration::from_secs(2);
/// Hours of work beyond which it wants to be asked for by number.
const HOURS: f64 = 1.0;

impl Job {
    /// Lists frames (videos are decoded once for it), opens weights, finds sizes.
    pub(crate) fn new(inputs: &[PathBuf], args: &RunArgs, ui: &mut Ui) -> Result<Self, CliError> {
        let options = ReadOptions::new(choice(args)).strict(args.strict).stop(Stop::when(stop::asked));
        // Minutes may pass where a video is long.
        if inputs.iter().any(|input| is_video(input)) {
            ui.say("listing the frames of videos");
        }
        let mut input = probe_with(inputs, &options)?;
        let weights = Weights::find(&args.weights)?;
        let preparation = Preparation::new(&weights, args, &input)?;
        input.notes.extend(preparation.note(&input));
        let checkpoint = weights.checkpoint();
        let taken = checkpoint.taken_for();
        input.notes.extend(
            taken.map(|name| format!("no config.json is beside the weights; by their tensors they are {name}")),
        );
        input.notes.extend(
            licence(checkpoint.name()).map(|licence| format!("licence of these weights, as published: {licence}")),
        );
        for note in &input.notes {
            ui.note(&format!("note: {note}"));
        }
        let (width, height) = preparation.size();
        let mut request = request(args, input.frames.len(), width, height);
        request.times = Some(input.frames.iter().map(|f| (f.video, f.frame)).collect());
        let known = match &args.cameras {
            Cameras::Known(path) => Some(match_cameras(&cameras::read(path)?, &input)?),
            Cameras::Decoder | Cameras::Rays => None,
        };
        if let Some(known) = &known {
            let prepared = input.frames.iter().zip(known).map(|(frame, camera)| preparation.camera(frame, camera));
            request = request.cameras(prepared.collect(), AlignTo::Given);
        }
        if let Some(masking) = masking::read(args, &weights, &input, &preparation, known.as_deref())? {
            masking.notes.iter().for_each(|note| ui.note(&format!("note: {note}")));
            input.notes.extend(masking.notes);
            request = request.masks(masking.masks);
        }
        if let Some(ruler) = &args.scale {
            request = request.distance(ruler.place(&input, |frame, end| preparation.place(frame, end))?);
        }
        let exports = chosen_exports(args, &weights, &mut request)?;
        let bent = known.iter().flatten().any(|camera| !camera.lens.distortion.is_none());
        let stated = exports.iter().find(|export| export.states_source_lenses());
        if let (true, Some(export)) = (bent, stated) {
            return Err(CliError::Usage(format!(
                "--export {export} states lenses without distortion, and the known cameras have some: undistort the pictures first, or leave it out"
            )));
        }
        Ok(Self { input, weights, preparation, request, known, exports, window: None })
    }

    /// Plans within the budget: all images, or a window if that was asked for or all do not fit. Says what would fit if none does.
    pub(crate) fn plan(&mut self, args: &RunArgs, caps: &Caps, cpu: bool, ui: &mut Ui) -> Result<RunPlan, CliError> {
        let waiting = RunPlan::host_bytes_of(&self.weights, &self.request);
        self.request.budget = budget(args, cpu, self.picture_bytes() + waiting)?;
        let images = self.request.images;
        match WindowSize::asked(args)? {
            Some(asked) if asked.images < images => self.use_windows(asked, args, ui)?,
            Some(asked) => self.note(&format!("a window of {} holds all {images} image(s)", asked.images), ui),
            None => {}
        }
        match RunPlan::new(&self.weights, &self.first_window()?, caps) {
            Ok(plan) => Ok(plan),
            Err(source @ (OmnixError::Budget { .. } | OmnixError::Graph(GraphError::TensorTooLarge { .. }))) => {
                let found = largest(&self.weights, &self.request, caps);
                if let Some(plan) = self.plan_windows(found, args, caps, ui)? {
                    return Ok(plan);
                }
                let most = self.input.sources.len();
                let suggestion = match found {
                    Some(n) if n < self.request.images && n >= most => {
                        let each = if most > 1 { format!(" of each of the {most} inputs") } else { String::new() };
                        format!("; --frames {}{each} would fit", n / most)
                    }
                    _ => String::new(),
                };
                Err(match source {
                    OmnixError::Graph(GraphError::TensorTooLarge { bytes, limit, .. }) => {
                        let run = format!("{} images need", self.request.images);
                        CliError::TensorTooLarge { run, needed: bytes, limit, suggestion }
                    }
                    source => CliError::TooLarge { source, suggestion },
                })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The plan of the largest window that fits, for a film that does not; none where that is too small, or something asked for needs
    /// all images at once.
    fn plan_windows(
        &mut self,
        most: Option<usize>,
        args: &RunArgs,
        caps: &Caps,
        ui: &mut Ui,
    ) -> Result<Option<RunPlan>, CliError> {
        let named = args.names_exports() && !windowing::split(&self.exports).1.is_empty();
        if self.window.is_some() || named || windowing::obstacle(args, self.weights.network().config()).is_some() {
            return Ok(None);
        }
        // What moves is computed in windows, whether or not it is exported.
        let motion = self.weights.network().config().trajectory.is_some();
        let as_asked = motion == self.request.motion;
        self.request.motion = motion;
        let most = if as_asked { most } else { largest(&self.weights, &self.request, caps) };
        let Some(size) = most.map(|most| WindowSize::fitting(most, args)).transpose()?.flatten() else {
            return Ok(None);
        };
        self.use_windows(size, args, ui)?;
        self.note(
            &format!(
                "{} images do not fit the memory at once: they are reconstructed in windows of {} that share {}, and joined",
                self.request.images, size.images, size.overlap
            ),
            ui,
        );
        Ok(Some(RunPlan::new(&self.weights, &self.first_window()?, caps)?))
    }

    /// Cuts the film into windows; leaves out the exports that need all images at once, unless they were named.
    fn use_windows(&mut self, size: WindowSize, args: &RunArgs, ui: &mut Ui) -> Result<(), CliError> {
        if let Some(obstacle) = windowing::obstacle(args, self.weights.network().config()) {
            return Err(CliError::Usage(format!("windows are not possible here: {obstacle}")));
        }
        let (single, all) = windowing::possible(&self.exports, args.names_exports())?;
        if !all.is_empty() {
            let all = windowing::names(&all);
            self.note(&format!("not made in windows, since they need all images at once: {all}"), ui);
        }
        self.exports = single;
        self.request.motion = self.weights.network().config().trajectory.is_some();
        self.window = Some(size);
        Ok(())
    }

    /// What is computed first: a window, or all images.
    fn first_window(&self) -> Result<Request, CliError> {
        let Some(size) = self.window else { return Ok(self.request.clone()) };
        Ok(window_request(&self.request, &Window { images: 0..size.images, shot: 0 })?)
    }

    /// Points that are followed: in windows no more, unless asked for by number, than that their paths take the memory of one window's.
    pub(crate) fn followed(&self, args: &RunArgs) -> u64 {
        match (self.window, args.points) {
            (Some(size), None) => args.followed() * size.images as u64 / self.request.images as u64,
            _ => args.followed(),
        }
    }

    /// What machines are told of the windows; null for a run without windows.
    pub(crate) fn windows_event(&self) -> Result<Value, CliError> {
        let count = self.windows()?;
        Ok(json!(self.window.map(|size| json!({ "images": size.images, "overlap": size.overlap, "count": count }))))
    }

    /// Windows of the film, if it has no cuts.
    pub(crate) fn windows(&self) -> Result<usize, CliError> {
        self.window.map_or(Ok(1), |size| size.count(self.request.images))
    }

    /// A remark for now and for the manifest.
    fn note(&mut self, text: &str, ui: &mut Ui) {
        ui.note(&format!("note: {text}"));
        self.input.notes.push(text.to_owned());
    }

    /// Bytes that reading the largest picture takes.
    pub(crate) fn reading_bytes(&self) -> u64 {
        self.input.largest().map_or(0, |frame| frame.bytes)
    }

    /// Refuses a picture that takes more than `most` bytes to decode, before any is.
    pub(crate) fn check_pictures(&self, most: Option<u64>) -> Result<(), CliError> {
        match (self.input.largest(), most) {
            (Some(frame), Some(most)) if frame.bytes > most => Err(CliError::LargePicture {
                width: frame.width,
                height: frame.height,
                needed: frame.bytes,
                most,
                path: frame.path.clone(),
            }),
            _ => Ok(()),
        }
    }

    /// Refuses hours of work that nobody asked for by number, such as a folder of ten thousand pictures named whole.
    pub(crate) fn check_work(&self, plan: &RunPlan, args: &RunArgs, tier: Tier) -> Result<(), CliError> {
        let flops = plan.flops().saturating_mul(self.windows()? as u64);
        let hours = seconds(flops, tier) / 3600.0;
        if hours > HOURS && args.frames.is_none() && args.fps.is_none() {
            let tera_flops = flops as f64 / 1e12;
            return Err(CliError::TooMuch { images: self.request.images, tera_flops, hours });
        }
        Ok(())
    }

    /// How large the run is.
    pub(crate) fn size(&self, args: &RunArgs, plan: &RunPlan) -> RunSize {
        let size = size(&self.request, self.input.sources.len(), args, Some(plan)).followed(self.followed(args));
        let windows = self.window.map_or(0, |_| self.windows().unwrap_or(0) as u64);
        // In windows what moves serves to join them.
        size.motion(self.request.motion && self.window.is_none()).windows(windows)
    }

    /// Bytes of all processed pictures, which exports of motion hold in memory; else they wait in a file.
    pub(crate) fn picture_bytes(&self) -> u64 {
        let pixels = (self.request.images * self.request.height * self.request.width) as u64;
        if self.request.motion && self.window.is_none() { 3 * pixels } else { 0 }
    }
}

/// The exports of a run, under a request with its cameras; where one of them moves, motion is asked for.
pub(crate) fn chosen_exports(
    args: &RunArgs,
    weights: &Weights,
    request: &mut Request,
) -> Result<Vec<Export>, CliError> {
    let network = weights.network().config();
    let trajectories = network.trajectory.is_some();
    let cameras = network.makes_cameras() || request.cameras.is_some();
    let exports = args.exports(trajectories, cameras);
    if exports.iter().any(|e| e.needs_motion()) && !trajectories {
        return Err(OmnixError::NoMotion { network: network.name.clone() }.into());
    }
    if let Some(export) = exports.iter().find(|e| e.needs_cameras()).filter(|_| !cameras) {
        let (name, without) = (&network.name, Export::ALL.iter().filter(|e| !e.needs_cameras() && !e.needs_motion()));
        let without: Vec<&str> = without.map(|e| e.name()).collect();
        return Err(CliError::Usage(format!(
            "--export {export} needs cameras, and {name} makes none: export {}, give known cameras to a metric network (--cameras PATH), or take an any-view network",
            without.join(", "),
        )));
    }
    if let Some(export) = exports.iter().find(|e| e.needs_gaussians()).filter(|_| network.gaussians.is_none()) {
        return Err(CliError::Usage(format!(
            "--export {export} needs a network with a Gaussian head, and {} has none: take da3-giant or da3nested-giant-large",
            network.name,
        )));
    }
    request.gaussians = exports.iter().any(|e| e.needs_gaussians());
    let features = exports.iter().any(|e| e.needs_features());
    if !features && !args.feature_blocks.is_empty() {
        return Err(CliError::Usage("--feature-blocks is for the export `features`: add it to --export".to_owned()));
    }
    if features {
        let named = if args.feature_blocks.is_empty() {
            network.backbone.out_layers.to_vec()
        } else {
            args.feature_blocks.clone()
        };
        *request = request.clone().features(named);
    }
    if args.all_tracks && !exports.contains(&Export::Tracks) {
        return Err(CliError::Usage("--all-tracks is for the export `tracks`: add it to --export".to_owned()));
    }
    request.motion = trajectories && exports.iter().any(|e| e.needs_motion() || e.motion_input().is_some());
    Ok(exports)
}

/// The request of `images` pictures under these options; one video in order.
pub(crate) fn request(args: &RunArgs, images: usize, width: u32, height: u32) -> Request {
    // One run: weights pass through, or leave when their stage is done.
    Request::new(images, height as usize, width as usize)
        .reference(args.reference)
        .rays(args.cameras == Cameras::Rays)
        .storage(args.weights_type.into())
        .budget(args.memory_budget)
        .keep_weights(false)
}

fn choice(args: &RunArgs) -> FrameChoice {
    let mut choice = FrameChoice::all().between(args.start, args.end);
    if let Some(step) = args.every {
        choice = choice.every(step);
    }
    if let Some(rate) = args.fps {
        choice = choice.at_rate(rate);
    }
    args.frames.map_or(choice, |count| choice.at_most(count))
}

/// What was asked for; else, where the device shares the machine's memory, 80 % of what is free, less the pictures.
fn budget(args: &RunArgs, cpu: bool, pictures: u64) -> Result<Option<u64>, CliError> {
    match (args.memory_budget, cpu) {
        (Some(bytes), _) => Ok(Some(bytes)),
        (None, true) => Ok(memory::available().map(|free| (free / 5 * 4).saturating_sub(pictures))),
        (None, false) => Ok(None),
    }
}

/// The most images that fit the budget: doubling, then bisection, for at most [`SEARCH`]. None if not even one does.
fn largest(weights: &Weights, request: &Request, caps: &Caps) -> Option<usize> {
    let since = Instant::now();
    let fits = |n: usize| {
        let mut fewer = request.clone().images(n).reference(None);
        fewer.times = request.times.as_ref().map(|times| times.iter().take(n).copied().collect());
        fewer.distance = None;
        fewer.masks = request.masks.as_ref().map(|masks| Arc::new(masks.part(0..n)));
        fewer.cameras = request.cameras.as_ref().map(|cameras| cameras.iter().take(n).copied().collect());
        RunPlan::new(weights, &fewer, caps).is_ok()
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
fn seconds(flops: u64, tier: Tier) -> f64 {
    let a_second = match tier {
        Tier::Software => 7e10,
        Tier::Baseline => 1e10,
        Tier::Gpu => 2e12,
    };
    flops as f64 / a_second
}

/// The same for people.
pub(crate) fn guess(flops: u64, tier: Tier) -> String {
    match seconds(flops, tier) {
        s if s < 120.0 => format!("{:.0} s", s.ceil()),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// Facts of a plan for people: one line each.
pub(crate) fn describe(plan: &RunPlan) -> String {
    let s = plan.summary();
    let [height, width] = s.image_size;
    let mut lines = vec![
        format!("{} image(s) of {width}x{height}, {} tokens", s.images, s.tokens),
        format!("memory  {} at most; weights {} in all", bytes::show(s.peak_bytes), bytes::show(s.weight_bytes)),
        format!("work    {:.1} GFLOP", s.flops as f64 / 1e9),
    ];
    for stage in &s.stages {
        let parts = match stage.chunk_rows.as_slice() {
            [] => String::new(),
            rows if stage.parts > 1 => format!(", chunks of {rows:?} rows"),
            _ => ", rows whole".to_owned(),
        };
        lines.push(format!(
            "  {:<15} {:>9}, of them weights {:>9}; {:>9.1} GFLOP; {} image(s) at a time{parts}",
            stage.name,
            bytes::show(stage.bytes),
            bytes::show(stage.weight_bytes),
            stage.flops as f64 / 1e9,
            stage.images,
        ));
    }
    if s.host_bytes > 0 {
        lines.push(format!("waiting {} on the host, until all images are done", bytes::show(s.host_bytes)));
    }
    if let Some(field) = &s.field {
        let place = if field.on_device { "on the device" } else { "in a file beside the results, an image at a time" };
        lines.push(format!("field   {}, {place}", bytes::show(field.bytes)));
    }
    lines.join("\n")
}

/// The same for machines, with names of the outputs.
pub(crate) fn plan_event(
    plan: &RunPlan,
    weights: &Weights,
    exports: &[Export],
    size: &RunSize,
    tier: Tier,
    budget: Option<u64>,
    reading: u64,
) -> Value {
    let mut event = serde_json::to_value(plan.summary()).unwrap_or_default();
    if let Value::Object(fields) = &mut event {
        let (width, height) = (plan.request.width, plan.request.height);
        fields.insert("image_size".to_owned(), json!([width, height]));
        fields.insert("process_bytes".to_owned(), json!(memory::process(plan, exports, size, tier, reading)));
        fields.insert("budget_bytes".to_owned(), json!(budget));
        fields.insert("network".to_owned(), json!(weights.network().config().name));
        fields.insert("weights".to_owned(), json!(weights.checkpoint().name()));
        fields.insert("outputs".to_owned(), json!(files_of(exports, size)));
    }
    event
}

/// How large a run of `request` is, with `videos` inputs, for what its exports leave and take; of a plan also the field's bytes.
pub(crate) fn size(request: &Request, videos: usize, args: &RunArgs, plan: Option<&RunPlan>) -> RunSize {
    let precision = FieldPrecision::from(args.field_type);
    let field = plan.and_then(|p| p.motion.as_ref()).map_or(0, |m| precision.bytes(&m.shape));
    let channels = plan.map_or(0, |plan| plan.feature_channels());
    let patches = (request.images * request.grid().0 * request.grid().1) as u64;
    let feature_bytes = 4 * patches * channels * request.features.len() as u64;
    RunSize::default()
        .images(request.images as u64)
        .videos(videos as u64)
        .pixels((request.height * request.width) as u64)
        .motion(request.motion)
        .points(args.points)
        .followed(args.followed())
        .all_pixels(args.all_tracks)
        .feature_bytes(feature_bytes)
        .field_bytes(field)
}

/// Names of the files that a run leaves; a kind of which there are many is "first to last".
pub(crate) fn files_of(exports: &[Export], size: &RunSize) -> Vec<String> {
    let files = exports.iter().flat_map(|export| export.files_in_short(size));
    files.chain(["manifest.json".to_owned()]).collect()
}

/// Name of the storage type for the manifest.
pub(crate) fn storage_name(args: &RunArgs) -> &'static str {
    match args.weights_type {
        WeightsType::F32 => "f32",
        WeightsType::F16 => "f16",
        WeightsType::I8 => "i8",
    }
}
