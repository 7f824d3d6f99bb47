//! Times of a whole network with seeded random weights: no checkpoint is needed to know how fast a device is.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use omnix_graph::profile::{Span, profile};
use omnix_graph::{Bindings, Executable, Graph, ParameterSource, Plan, PlanOptions, WeightStore};
use omnix_kernels::bench::Clock;
use omnix_model::config::NetworkConfig;
use omnix_model::{BackboneSpec, HeadSpec, Network, Parts};

use crate::engine::Engine;
use crate::error::OmnixError;
use crate::request::PATCH;

/// Weights that depend on the names of the tensors alone. Matrices keep the scale of what passes through them, norms are
/// near one, biases near zero, so that all numbers stay finite.
#[derive(Clone, Debug)]
pub struct RandomWeights {
    shapes: BTreeMap<String, Vec<usize>>,
}

impl RandomWeights {
    /// For a network.
    #[must_use]
    pub fn new(config: &NetworkConfig) -> Self {
        let manifest = omnix_model::manifest(config, &Parts::default());
        Self { shapes: manifest.expected().iter().map(|e| (e.name.clone(), e.shape.clone())).collect() }
    }

    /// Names and shapes of all tensors, in the order of their names.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.shapes.iter().map(|(name, shape)| (name.as_str(), shape.as_slice()))
    }
}

impl ParameterSource for RandomWeights {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        let shape = self.shapes.get(name).ok_or_else(|| format!("BUG: no weight `{name}`"))?;
        let inputs = shape.get(1..).map_or(1, |rest| rest.iter().product::<usize>());
        let (centre, width) = match shape.len() {
            0 | 1 if name.ends_with("weight") => (1.0, 0.1),
            0 | 1 => (0.0, 0.02),
            _ => (0.0, (3.0 / inputs as f32).sqrt()),
        };
        let mut numbers = Numbers::new(name);
        Ok((0..shape.iter().product()).map(|_| centre + width * numbers.next()).collect())
    }
}

/// SplitMix64 seeded by a text (FNV-1a), as numbers from -1 to 1.
struct Numbers(u64);

impl Numbers {
    fn new(text: &str) -> Self {
        Self(text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)))
    }

    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

/// How long a network takes.
#[derive(Clone, Copy, Debug)]
pub struct NetworkTime {
    /// Images.
    pub images: usize,
    /// Operations of the backbone.
    pub backbone_flops: u64,
    /// Seconds of the backbone.
    pub backbone: Seconds,
    /// Operations of the heads of all images.
    pub head_flops: u64,
    /// Seconds of the heads of all images.
    pub head: Seconds,
}

/// The shortest of several runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seconds {
    /// By the wall.
    pub wall: f64,
    /// Processor time of all threads over the number of processors: what an idle machine would show, for software devices.
    /// Linux only.
    pub quiet: Option<f64>,
}

impl std::ops::Add for Seconds {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { wall: self.wall + other.wall, quiet: self.quiet.zip(other.quiet).map(|(a, b)| a + b) }
    }
}

impl std::ops::Mul<f64> for Seconds {
    type Output = Self;

    fn mul(self, times: f64) -> Self {
        Self { wall: self.wall * times, quiet: self.quiet.map(|q| q * times) }
    }
}

/// A network on a device, ready to be timed.
#[derive(Debug)]
pub struct NetworkBench {
    images: usize,
    backbone: Executable,
    head: Executable,
}

impl NetworkBench {
    /// Plans `images` pictures of `height` x `width`, uploads random weights and pictures, and makes the pipelines.
    ///
    /// # Errors
    /// A size that is no multiple of 14, or memory running out.
    pub fn new(
        engine: &Engine,
        config: &NetworkConfig,
        images: usize,
        height: usize,
        width: usize,
    ) -> Result<Self, OmnixError> {
        let (network, gpu) = (Network::new(config.clone()), engine.gpu());
        let grid = (height / PATCH, width / PATCH);
        let spec = BackboneSpec {
            images,
            grid,
            reference: network.default_reference(),
            cameras_given: false,
            times: (0..images as u32).map(|i| (0, i)).collect(),
            export_layers: Vec::new(),
        };
        let (mut backbone, mut head) = (Graph::new(), Graph::new());
        network.backbone(&mut backbone, &spec)?;
        network.head(&mut head, &HeadSpec { frames: 1, grid, rays: false, points: false, gaussians: false })?;
        let plan = |graph: &Graph| Plan::new(graph, &gpu.caps, &PlanOptions::default());
        let (backbone, head) = (plan(&backbone)?, plan(&head)?);
        let keys: Vec<_> = backbone.weights.iter().chain(&head.weights).cloned().collect();
        let mut report = |_, _| ControlFlow::Continue(());
        let store = WeightStore::load(gpu, &RandomWeights::new(config), &keys, &mut report)?;
        let backbone = Executable::new(gpu, backbone, &store, &Bindings::default())?;
        let head = Executable::new(gpu, head, &store, &Bindings::default())?;
        let mut numbers = Numbers::new("images");
        let pictures: Vec<f32> = (0..images * 3 * height * width).map(|_| 2.0 * numbers.next()).collect();
        backbone.write("images", &pictures)?;
        Ok(Self { images, backbone, head })
    }

    /// Runs once unmeasured, then `times` times.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn time(&self, times: usize) -> Result<NetworkTime, OmnixError> {
        let least = |run: &dyn Fn() -> Result<(), OmnixError>| {
            run()?;
            let mut best = Seconds { wall: f64::INFINITY, quiet: None };
            for _ in 0..times.max(1) {
                let clock = Clock::start();
                run()?;
                let (wall, quiet) = clock.seconds();
                best.wall = best.wall.min(wall);
                best.quiet = match (best.quiet, quiet) {
                    (Some(a), Some(b)) => Some(a.min(b)),
                    (a, b) => a.or(b),
                };
            }
            Ok::<_, OmnixError>(best)
        };
        let go = |_, _| ControlFlow::Continue(());
        let backbone = least(&|| Ok(self.backbone.run(&mut { go })?))?;
        for k in 0..4 {
            let name = format!("feat.{k}");
            let (from, to) = (self.backbone.slice(&name)?, self.head.slice(&name)?);
            let gpu = self.backbone.gpu();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&from.buffer, from.offset, &to.buffer, to.offset, to.size);
            gpu.queue.submit([encoder.finish()]);
        }
        let head = least(&|| Ok(self.head.run(&mut { go })?))? * self.images as f64;
        Ok(NetworkTime {
            images: self.images,
            backbone_flops: self.backbone.plan().flops(),
            backbone,
            head_flops: self.head.plan().flops() * self.images as u64,
            head,
        })
    }

    /// Every piece of one run of backbone and head, timed by the device.
    ///
    /// # Errors
    /// When the device has no timestamps or is lost.
    pub fn spans(&self) -> Result<Vec<Span>, OmnixError> {
        let mut spans = profile(&self.backbone)?;
        let end = spans.iter().map(|s| s.start_ns + s.length_ns).fold(0.0, f64::max);
        spans.extend(profile(&self.head)?.into_iter().map(|s| Span { start_ns: s.start_ns + end, ..s }));
        Ok(spans)
    }
}
