//! What each stage holds, and how a budget is shared out among them.

use omnix_geometry::{AlignTo, CAMERAS_UNIT, CANONICAL_UNIT, GAUSSIAN_NUMBERS, METRES, NETWORK_UNIT};
use omnix_graph::graph::{Source, ValueInfo};
use omnix_graph::{Graph, GraphError, Plan, PlanOptions};
use omnix_kernels::{Caps, Tier};
use omnix_model::config::{DepthUnit, NetworkConfig};
use omnix_model::{BackboneSpec, HeadSpec, ModelError, MotionSpec, Network, Reference, SamplingSpec};

use super::{MetricPlan, MotionPlan, OVERHEAD, RunPlan, feature_name, host_bytes, image_bytes};
use crate::error::OmnixError;
use crate::field::{self, FieldShape};
use crate::request::{FieldPlace, Request};
use crate::weights::Weights;

/// A field's sizes, and whether it is kept on the device.
type Place<'a> = (&'a FieldShape, bool);

/// Bytes of the backbone's results `kept` beside a plan that runs `runs` times: one that runs once has those that it reads as its inputs.
fn held_features(plan: &Plan, runs: usize, kept: u64) -> u64 {
    let kept_there = |name: &str| name.starts_with("feat.") || name == "pictures";
    let read = |(_, info): (_, &ValueInfo)| {
        (matches!(info.source, Source::Input) && kept_there(&info.name)).then(|| info.shape.bytes())
    };
    let inputs: u64 = plan.graph.values().filter_map(read).sum();
    kept - if runs == 1 { inputs } else { 0 }
}

/// Bytes that the head's stage holds beside its plan: features, what the module needs, and staging for the results.
pub(super) fn head_held(head: &Plan, runs: usize, kept: u64, tokens: u64, field: Option<Place<'_>>) -> u64 {
    let results: u64 = output_sizes(&head.graph).sum();
    let points = field.map_or(0, |(shape, resident)| if resident { shape.all_points() } else { 0 });
    held_features(head, runs, kept) + tokens + points + results
}

/// Bytes of staging for the encoder's features of the images that go through the head at a time.
pub(super) fn staged_features(backbone: &Graph, head: &Plan, request: &Request) -> u64 {
    let of = |block: &usize| backbone.find(&feature_name(*block)).map_or(0, |value| backbone.shape(value).bytes());
    let all: u64 = request.features.iter().map(of).sum();
    let frames = head.graph.find("feat.0").map_or(1, |value| head.graph.shape(value)[0]);
    all / request.images as u64 * frames as u64
}

/// The same of the head of a metric network, beside the images that the other network is still to see.
pub(super) fn metric_head_held(head: &Plan, runs: usize, kept: u64, images: u64) -> u64 {
    head_held(head, runs, kept, 0, None) + images
}

/// Bytes that the module's stage holds beside its plan, of which features and tokens are inputs.
pub(super) fn module_held(module: &Plan, kept: u64, (shape, resident): Place<'_>) -> u64 {
    let field = if resident { shape.all_points() + shape.all_fields() } else { shape.field_bytes() };
    held_features(module, 1, kept) + field
}

/// Bytes that the sampling head's stage holds beside its plan.
pub(super) fn sampling_held(
    sampling: &Plan,
    runs: usize,
    kept: u64,
    (shape, resident): Place<'_>,
    request: &Request,
) -> u64 {
    // Results are read back one by one; offsets and weights only where they go to a file, or masks change them.
    let staging = if resident && request.said_masks().is_none() {
        shape.pixels() as u64 * 4
    } else {
        output_sizes(&sampling.graph).max().unwrap_or(0)
    };
    held_features(sampling, runs, kept) + staging + if resident { shape.bytes() } else { 0 }
}

fn output_sizes(graph: &Graph) -> impl Iterator<Item = u64> + '_ {
    graph.outputs().iter().map(|v| graph.shape(*v).bytes())
}

/// A network's backbone and head before they are fitted.
struct Geometry<'a> {
    network: Network,
    /// Whether it is the metric network of a nested one.
    metric: bool,
    request: &'a Request,
    caps: &'a Caps,
    options: PlanOptions,
    graph: Graph,
    /// The backbone's plan without a bound.
    free: Plan,
    /// Bytes of what the backbone makes.
    kept: u64,
    /// The view that is first inside, where the network does not choose it.
    first_view: Option<usize>,
}

impl<'a> Geometry<'a> {
    fn new(
        network: Network,
        metric: bool,
        request: &'a Request,
        caps: &'a Caps,
        options: &PlanOptions,
    ) -> Result<Self, OmnixError> {
        let own = (network.default_reference(), false);
        let (reference, cameras_given) = match metric {
            true => own,
            false => (request.reference.unwrap_or(own.0), request.feeds_cameras(network.config())),
        };
        let spec = BackboneSpec {
            images: request.images,
            grid: request.grid(),
            reference,
            cameras_given,
            times: request.image_times(),
            export_layers: if metric { Vec::new() } else { request.features.clone() },
        };
        let mut graph = Graph::new();
        let first_view = match network.backbone(&mut graph, &spec)?.reference {
            Reference::Known(view) => Some(view),
            Reference::Selected(_) => None,
        };
        let free = Plan::new(&graph, caps, options)?;
        let kept = output_sizes(&graph).sum();
        Ok(Self { network, metric, request, caps, options: *options, graph, free, kept, first_view })
    }

    fn head(&self, frames: usize, streamed: bool) -> Result<Plan, OmnixError> {
        let (rays, points) = (self.request.rays && !self.metric, self.request.motion && !self.metric);
        let gaussians = self.request.gaussians && !self.metric;
        let spec = HeadSpec { frames, grid: self.request.grid(), rays, points, gaussians };
        let mut graph = Graph::new();
        self.network.head(&mut graph, &spec)?;
        Ok(Plan::new(&graph, self.caps, &self.options.parts(1).streamed(streamed))?)
    }

    /// Bytes of the weights of both.
    fn weight_bytes(&self) -> Result<u64, OmnixError> {
        Ok(self.free.weight_bytes() + self.head(1, false)?.weight_bytes())
    }

    /// The backbone within the budget.
    fn plan_backbone(&self, budget: &mut Budget) -> Result<Option<Plan>, OmnixError> {
        budget.plan_whole(&self.graph, self.caps, &self.options, &self.free, 0)
    }

    /// The metric network within the budget, with both networks' images on the device all the while.
    fn plan_metric(&self, budget: &mut Budget, usual: usize) -> Result<Option<MetricPlan>, OmnixError> {
        let backbone = self.plan_backbone(budget)?;
        let held = |plan: &Plan, runs| metric_head_held(plan, runs, self.kept, image_bytes(self.request));
        let head = budget.plan_chunked((self.request.head_images, usual), |f, s| self.head(f, s), held)?;
        let (Some(backbone), Some((head, head_images))) = (backbone, head) else { return Ok(None) };
        Ok(Some(MetricPlan { backbone, head, head_images, kept: self.kept }))
    }
}

fn module(weights: &Weights, request: &Request) -> Result<Graph, OmnixError> {
    let forced = request.said_masks().is_some();
    let spec = MotionSpec { images: request.images, grid: request.grid(), times: request.image_times(), forced };
    let mut graph = Graph::new();
    weights.network().motion(&mut graph, &spec)?;
    Ok(graph)
}

fn sampling(weights: &Weights, request: &Request, frames: usize) -> Result<Graph, OmnixError> {
    let spec = SamplingSpec { frames, times: request.images, grid: request.grid() };
    let mut graph = Graph::new();
    weights.network().sampling(&mut graph, &spec)?;
    Ok(graph)
}

/// A budget while it is shared out: the least that works is the most that any stage needs at least.
struct Budget {
    /// None for no bound.
    bytes: Option<u64>,
    /// Weights on the device in every stage, if they stay there.
    resting: Option<u64>,
    /// Images of the run.
    images: usize,
    least: u64,
}

impl Budget {
    /// Bytes that a stage with these results held may take for its plan, weights that pass through included.
    fn room(&self, held: u64) -> Option<u64> {
        Some(self.bytes?.saturating_sub(self.beside_plan(0) + held))
    }

    /// Bytes of the weights in a stage that has these of its own, and of what every stage needs.
    fn beside_plan(&self, weights: u64) -> u64 {
        self.resting.unwrap_or(weights) + OVERHEAD
    }

    /// Whether a stage fits that takes `bytes` beside its weights.
    fn fits(&self, weights: u64, bytes: u64) -> bool {
        self.bytes.is_none_or(|budget| self.beside_plan(weights) + bytes <= budget)
    }

    /// Notes what a stage needs at least, weights that pass through included.
    fn needs(&mut self, bytes: u64) {
        self.least = self.least.max(self.beside_plan(0) + bytes);
    }

    /// One graph over all images, its chains cut as fine as the budget wants; `None` if that is too small.
    fn plan_whole(
        &mut self,
        graph: &Graph,
        caps: &Caps,
        options: &PlanOptions,
        free: &Plan,
        held: u64,
    ) -> Result<Option<Plan>, OmnixError> {
        let Some(room) = self.room(held) else { return Ok(Some(free.clone())) };
        match Plan::new(graph, caps, &options.budget(room)) {
            Ok(plan) => Ok(Some(plan)),
            Err(GraphError::Budget { least, .. }) => {
                self.needs(held + least);
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// A graph over a few images: the number `wanted`, or the largest that fits, from `usual` down; `None` if none fits. All at once
    /// is tried last: weights may pass through then, and what the backbone made is not held twice.
    fn plan_chunked(
        &mut self,
        (wanted, usual): (Option<usize>, usize),
        plan: impl Fn(usize, bool) -> Result<Plan, OmnixError>,
        held: impl Fn(&Plan, usize) -> u64,
    ) -> Result<Option<(Plan, usize)>, OmnixError> {
        let most = wanted.unwrap_or(usual).clamp(1, self.images);
        let all = (wanted.is_none() && most < self.images).then_some(self.images);
        let mut least = u64::MAX;
        for count in (1..=most).rev().chain(all) {
            let runs = self.images.div_ceil(count);
            let tried = match plan(count, self.resting.is_none() && runs == 1) {
                Err(OmnixError::Graph(GraphError::TensorTooLarge { .. })) if count > most => continue,
                tried => tried?,
            };
            let (weights, bytes) = (tried.resident_weight_bytes(), tried.working_bytes() + held(&tried, runs));
            if self.fits(weights, bytes) {
                return Ok(Some((tried, count)));
            }
            least = least.min(self.beside_plan(weights) + bytes);
        }
        self.least = self.least.max(least);
        Ok(None)
    }
}

impl RunPlan {
    /// Plans `request` for a device with `caps`.
    ///
    /// # Errors
    /// [`OmnixError::Budget`] with the least that works, or what is wrong with the request.
    pub fn new(weights: &Weights, request: &Request, caps: &Caps) -> Result<Self, OmnixError> {
        request.check()?;
        if request.motion {
            field::motion_of(weights)?;
        }
        let config = weights.network().config();
        request.check_distance(config)?;
        if request.feeds_cameras(config) {
            request.check_given_cameras()?;
        } else if request.cameras.is_some() && config.unit != DepthUnit::Canonical {
            let cure = format!("{} makes depth without cameras or a unit; leave them out", config.name);
            return Err(ModelError::Request { what: "given cameras".to_owned(), cure }.into());
        }
        plan(weights, request, caps)
    }
}

/// Plans all stages.
fn plan(weights: &Weights, request: &Request, caps: &Caps) -> Result<RunPlan, OmnixError> {
    let streamed = !request.keep_weights;
    let options = PlanOptions::default().storage(request.storage).parts(request.parts).streamed(streamed);
    let usual = if caps.tier == Tier::Gpu { 4 } else { 1 };
    let geometry = Geometry::new(weights.network().clone(), false, request, caps, &options)?;
    let kept = geometry.kept;
    let metric = weights.network().metric();
    let metric = metric.map(|network| Geometry::new(network, true, request, caps, &options)).transpose()?;
    let motion = if request.motion { Some(Motion::new(weights, request, caps, &options)?) } else { None };
    let resting = if request.keep_weights {
        let motion = motion.as_ref().map_or(0, |m| m.module.weight_bytes() + m.sampling.weight_bytes());
        let metric = metric.as_ref().map_or(Ok(0), Geometry::weight_bytes)?;
        Some(geometry.weight_bytes()? + metric + motion)
    } else {
        None
    };
    let mut budget = Budget { bytes: request.budget, resting, images: request.images, least: 0 };
    let planned = geometry.plan_backbone(&mut budget)?;
    let metric_plan = match &metric {
        Some(metric) => metric.plan_metric(&mut budget, usual)?,
        None => None,
    };
    let tokens = motion.as_ref().map_or(0, |m| m.token_bytes);
    // On the device if that fits; else in a file, where less may fit.
    let places: &[bool] = match (&motion, &request.field) {
        (None, _) => &[false],
        (Some(_), FieldPlace::Device) => &[true],
        #[cfg(feature = "io")]
        (Some(_), FieldPlace::Spool(_)) => &[false],
        #[cfg(feature = "io")]
        (Some(_), FieldPlace::Auto | FieldPlace::AutoIn(_)) => &[true, false],
        // There are no files.
        #[cfg(not(feature = "io"))]
        (Some(_), FieldPlace::Auto) => &[true],
    };
    let least = budget.least;
    for &resident in places {
        budget.least = least;
        let place = motion.as_ref().map(|m| (&m.shape, resident));
        let images = if request.gaussians { image_bytes(request) } else { 0 };
        let held = |plan: &Plan, runs| {
            let staged = staged_features(&geometry.graph, plan, request);
            head_held(plan, runs, kept + images, tokens, place) + staged
        };
        let head = budget.plan_chunked((request.head_images, usual), |f, s| geometry.head(f, s), held)?;
        let moving = match &motion {
            Some(motion) => motion.plan(&mut budget, kept, resident, usual)?,
            None => None,
        };
        if let (Some(backbone), Some((head, head_images))) = (&planned, head)
            && moving.is_some() == motion.is_some()
            && metric_plan.is_some() == metric.is_some()
        {
            let (request, backbone) = (request.clone(), backbone.clone());
            let waiting = waiting(weights.network(), &request);
            let unit = unit(weights.network().config(), &request);
            let (metric, motion) = (metric_plan, moving);
            let first_view = geometry.first_view;
            return Ok(RunPlan {
                request,
                metric,
                backbone,
                head,
                head_images,
                motion,
                kept,
                waiting,
                unit,
                first_view,
            });
        }
    }
    Err(OmnixError::Budget {
        budget: request.budget.unwrap_or(u64::MAX),
        least: budget.least,
        hint: "fewer or smaller images take less, and so do weights stored as f16 or i8",
    })
}

/// Unit of length of the results of a run.
fn unit(config: &NetworkConfig, request: &Request) -> &'static str {
    match (config.unit, request.cameras.is_some()) {
        (_, true) if config.makes_cameras() && request.align == AlignTo::Given => CAMERAS_UNIT,
        (DepthUnit::Canonical, true) | (DepthUnit::Metres, _) => METRES,
        (DepthUnit::Canonical, false) => CANONICAL_UNIT,
        (DepthUnit::Own, _) if request.distance.is_some() => METRES,
        (DepthUnit::Own, _) => NETWORK_UNIT,
    }
}

impl RunPlan {
    /// [`RunPlan::host_bytes`] of a run that is not planned yet.
    #[must_use]
    pub fn host_bytes_of(weights: &Weights, request: &Request) -> u64 {
        host_bytes(request, waiting(weights.network(), request))
    }
}

/// Numbers of a pixel, and of a cell of the ray maps, that wait on the host: depth and sky, or both networks' depth, sky and
/// confidence.
fn waiting(network: &Network, request: &Request) -> [u64; 2] {
    let config = network.config();
    match (config.makes_sky(), config.metric.is_some()) {
        (false, _) => [0, 0],
        (true, false) => [2, 0],
        (true, true) => {
            [4 + if request.gaussians { GAUSSIAN_NUMBERS as u64 } else { 0 }, if request.rays { 7 } else { 0 }]
        }
    }
}

/// The stages of motion before they are fitted.
struct Motion<'a> {
    weights: &'a Weights,
    request: &'a Request,
    caps: &'a Caps,
    options: PlanOptions,
    graph: Graph,
    module: Plan,
    sampling: Plan,
    shape: FieldShape,
    token_bytes: u64,
}

impl<'a> Motion<'a> {
    fn new(
        weights: &'a Weights,
        request: &'a Request,
        caps: &'a Caps,
        options: &PlanOptions,
    ) -> Result<Self, OmnixError> {
        let graph = module(weights, request)?;
        let module = Plan::new(&graph, caps, options)?;
        let sampling = Plan::new(&sampling(weights, request, 1)?, caps, &options.parts(1))?;
        let shape = FieldShape::of(&graph, &sampling.graph, request)?;
        let tokens = graph.find("traj.point_tokens");
        let token_bytes = tokens.map_or(0, |v| graph.shape(v).bytes());
        Ok(Self { weights, request, caps, options: *options, graph, module, sampling, shape, token_bytes })
    }

    /// The stages within the budget, with the field on the device or in a file; `None` if they do not fit.
    fn plan(
        &self,
        budget: &mut Budget,
        kept: u64,
        resident: bool,
        usual: usize,
    ) -> Result<Option<MotionPlan>, OmnixError> {
        let place = (&self.shape, resident);
        let held = module_held(&self.module, kept, place);
        let module = budget.plan_whole(&self.graph, self.caps, &self.options, &self.module, held)?;
        let plan = |frames, streamed| {
            let graph = sampling(self.weights, self.request, frames)?;
            Ok(Plan::new(&graph, self.caps, &self.options.parts(1).streamed(streamed))?)
        };
        let held = |plan: &Plan, runs| sampling_held(plan, runs, kept, place, self.request);
        let sampling = budget.plan_chunked((self.request.sampling_images, usual), plan, held)?;
        let store = if resident { self.shape.bytes() } else { 0 };
        let room = budget.room(store);
        let motion = field::motion_of(self.weights)?;
        let (evaluation, evaluation_bytes) = field::fit(&self.shape, motion, self.caps, resident, room)?;
        budget.needs(store + field::least(&self.shape, motion, self.caps, resident)?);
        let fits = budget.fits(0, store + evaluation_bytes);
        let (Some(module), Some((sampling, sampling_images)), true) = (module, sampling, fits) else { return Ok(None) };
        let (shape, token_bytes) = (self.shape, self.token_bytes);
        Ok(Some(MotionPlan {
            module,
            sampling,
            sampling_images,
            shape,
            resident,
            evaluation,
            evaluation_bytes,
            token_bytes,
        }))
    }
}
