//! The configuration of a training run: one TOML file that holds everything but where the run writes.
//!
//! ```toml
//! steps = 20000                     # also the length of the schedule
//! seed = 1                          # of start values, order of data and everything else random
//! memory_budget = "4GiB"
//! augment = true                    # colours changed at random
//! layer_scale = 0.01                # what the factors of the branches of transformer blocks start as, from random values
//! weights_type = "f32"              # or "f16": copies that products read, of f32 weights that are trained; half their bytes
//! dropout = 0.1                     # share left out at random in the layers that score tokens and make their gain; 0 for none
//! network = "nano.json"             # or a table [network] with the fields of an omnix-1 config.json
//! start = { from = "seed" }         # or { from = "checkpoint", path = ".." }, { from = "depth-anything-3", path = ".." }
//!
//! [sample]                          # what is drawn from the data: number of images, and their width and height
//! images = 4
//! scenes = 1                        # number of scenes that the images come from, equally many of each
//! size = [140, 84]
//! [[data]]                          # as many as wanted, drawn in proportion to their weights
//! made = "shapes"                   # or made = "scenes" (recipe, photos), or path = "..", a folder with scenes of a data set; set, shares, step
//! weight = 1.0
//! [[group]]                         # the first whose name is part of a tensor's name takes it; none: those of the release
//! name = "backbone"
//! rate = 2e-5
//! [[group]]
//! name = ""
//! rate = 2e-4
//!
//! [optimiser]                       # AdamW
//! [schedule]                        # warm_up, length, last, full_first_step
//! [loss]                            # preset = "release" or "paper", and what differs from it
//! [validation]                      # every, samples, data
//! [checkpoint]                      # every_steps, every_minutes, best
//! ```
//!
//! Paths are relative to the file. A key that is not known is refused with the nearest one that is ([`crate::read_config`]), and so are keys
//! that contradict each other.

mod check;

use std::path::PathBuf;

use omnix_model::NetworkConfig;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::groups::Group;
use crate::init::LAYER_SCALE;
use crate::loss::LossConfig;
use crate::objective;
use crate::schedule::Schedule;

/// Everything that fixes a training run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Steps in all.
    pub steps: u64,
    /// Seed of everything random.
    #[serde(default)]
    pub seed: u64,
    /// Memory that a step may take on the device, such as `4GiB`.
    #[serde(default)]
    pub memory_budget: Option<String>,
    /// The network.
    pub network: NetworkSource,
    /// Where its weights come from.
    #[serde(default)]
    pub start: Start,
    /// What the factors of the branches of transformer blocks (layer scale) start as where they start from random values: 0.01, as
    /// `spec/omnix.md` 11.3 has it for adding to a trained network. A small network that starts from nothing learns sooner with 1.
    #[serde(default = "layer_scale")]
    pub layer_scale: f32,
    /// How the copies of trained weights are stored that matrix products and convolutions read. The weights themselves, their moments,
    /// frozen weights and everything else are f32 always.
    #[serde(default)]
    pub weights_type: Copies,
    /// What is drawn from the data.
    pub sample: SampleConfig,
    /// The data.
    #[serde(default)]
    pub data: Vec<DataConfig>,
    /// Whether colours are changed at random (`spec/omnix.md` 11.3).
    #[serde(default = "yes")]
    pub augment: bool,
    /// Share of numbers left out at random in the layers that score tokens and in those of their gain (`spec/omnix.md` section 5); 0
    /// for none.
    #[serde(default = "tenth")]
    pub dropout: f32,
    /// Rates by tensor names.
    #[serde(default = "Group::release")]
    pub group: Vec<Group>,
    /// The optimiser.
    #[serde(default)]
    pub optimiser: Optimiser,
    /// Rates by steps.
    #[serde(default)]
    pub schedule: Schedule,
    /// The objective ([`crate::loss::config`]); `preset` names the one that it differs from.
    #[serde(default, deserialize_with = "objective::read")]
    pub loss: LossConfig,
    /// Losses on a fixed set of samples.
    #[serde(default)]
    pub validation: Option<Validation>,
    /// When the state is saved.
    #[serde(default)]
    pub checkpoint: Checkpoints,
}

/// How copies of trained weights are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Copies {
    /// In full.
    #[default]
    F32,
    /// In half the bytes, rounded to 11 bits: what small steps of training change is kept in the weights, not in their copies.
    F16,
}

/// A network: a file, or its fields in place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum NetworkSource {
    /// A `config.json`.
    Path(PathBuf),
    /// What would be in it.
    Inline(serde_json::Map<String, Value>),
}

/// Where the weights of a new run come from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(tag = "from", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// Random values.
    #[default]
    Seed,
    /// A checkpoint of ours, as far as it fits.
    Checkpoint {
        /// Its folder or file.
        path: PathBuf,
    },
    /// A Depth Anything 3 checkpoint, as far as it fits; its depth head is also the start of the sampling head.
    #[serde(rename = "depth-anything-3")]
    DepthAnything3 {
        /// Its folder or file.
        path: PathBuf,
    },
}

/// The shape of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleConfig {
    /// Number of images.
    pub images: u32,
    /// Number of scenes that the images come from, equally many of each. With more than one a network with trajectories is refused: the
    /// images of different scenes have nothing to tell each other. Where a network starts from nothing, many scenes in a step are worth more than many views of one.
    #[serde(default = "single")]
    pub scenes: u32,
    /// Width and height in pixels: multiples of 14.
    pub size: [u32; 2],
}

/// A source of samples: `made` or `path`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// Samples that are made while training.
    #[serde(default)]
    pub made: Option<Made>,
    /// Of made scenes: the file of the recipe that they are drawn from; the standard one where it is not given.
    #[serde(default)]
    pub recipe: Option<PathBuf>,
    /// Of made scenes: a folder with photographs for textures.
    #[serde(default)]
    pub photos: Option<PathBuf>,
    /// A folder with scenes of a data set on disk.
    #[serde(default)]
    pub path: Option<PathBuf>,
    /// The data set, by the name that `omnix data` gives it; whichever the scenes look like where it is not given.
    #[serde(default)]
    pub set: Option<String>,
    /// Shares of one camera, of several videos, and of photographs and a video; those of the data set where they are not given.
    #[serde(default)]
    pub shares: Option<[f64; 3]>,
    /// The largest step between frames of one camera.
    #[serde(default)]
    pub step: Option<u32>,
    /// Its share among all sources is its weight over the sum of weights.
    #[serde(default = "one")]
    pub weight: f64,
}

/// A source that makes its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Made {
    /// Moving boxes and spheres ([`crate::shapes`]).
    Shapes,
    /// Dynamic scenes in many places ([`crate::scenes`]).
    Scenes,
}

const fn one() -> f64 {
    1.0
}

const fn layer_scale() -> f32 {
    LAYER_SCALE
}

const fn tenth() -> f32 {
    0.1
}

const fn single() -> u32 {
    1
}

const fn yes() -> bool {
    true
}

/// AdamW, the clip and the average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Optimiser {
    /// Shares of the old means of gradients and of their squares.
    pub betas: [f64; 2],
    /// Added to the root of the second mean.
    pub eps: f64,
    /// Weight decay of groups that have none of their own.
    pub decay: f64,
    /// The norm that the gradient is clipped to; 0 for no clip.
    pub clip: f64,
    /// Samples whose gradients make one step.
    pub accumulate: u32,
    /// Share of the old average of the weights that a step keeps, such as 0.999; 0 for no average.
    pub average: f64,
}

impl Default for Optimiser {
    fn default() -> Self {
        Self { betas: [0.9, 0.95], eps: 1e-8, decay: 0.05, clip: 1.0, accumulate: 1, average: 0.0 }
    }
}

/// Losses on samples that are never trained on, the same ones each time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validation {
    /// Number of steps from one to the next; also at the end.
    pub every: u64,
    /// Number of samples.
    pub samples: u32,
    /// Where they come from; where it is not given, from the sources of training with another seed, if those make their samples.
    #[serde(default)]
    pub data: Vec<DataConfig>,
}

/// When the state is saved. It is also saved when the run ends or is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Checkpoints {
    /// Number of steps from one to the next; 0 for not by steps.
    pub every_steps: u64,
    /// Minutes from one to the next; 0 for not by time.
    pub every_minutes: f64,
    /// Whether the one with the lowest validation loss is kept beside the last. With validation, unless said otherwise.
    pub best: Option<bool>,
}

impl Default for Checkpoints {
    fn default() -> Self {
        Self { every_steps: 0, every_minutes: 10.0, best: None }
    }
}

impl Config {
    /// Whether the weights are averaged.
    #[must_use]
    pub fn averaged(&self) -> bool {
        self.optimiser.average > 0.0
    }

    /// Whether the best checkpoint is kept.
    #[must_use]
    pub fn keeps_best(&self) -> bool {
        self.checkpoint.best.unwrap_or(self.validation.is_some())
    }

    /// The decay of a group.
    #[must_use]
    pub fn decay(&self, group: &Group) -> f64 {
        group.decay.unwrap_or(self.optimiser.decay)
    }

    /// The configuration as JSON, as checkpoints and pages show it.
    #[must_use]
    pub fn settings(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

/// A configuration that was read, with the network that it names.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// The configuration; paths in it can be opened from here.
    pub config: Config,
    /// The network's `config.json`.
    pub network_json: Value,
    /// The network.
    pub network: NetworkConfig,
}
