//! A network and what can be asked of it.

use omnix_graph::Graph;

use crate::backbone::{self, BackboneOutputs, BackboneSpec, ReferenceChoice};
use crate::config::{Family, NetworkConfig, TrajectoryConfig};
use crate::dpt::{self, HeadOutputs, HeadSpec};
use crate::motion::{self, Dropout, MotionOutputs, MotionSpec};
use crate::sampling::{self, SamplingOutputs, SamplingSpec};
use crate::{ModelError, PATCH};

/// A network that records itself into graphs.
#[derive(Clone, Debug)]
pub struct Network {
    config: NetworkConfig,
}

impl Network {
    /// The network of a configuration. One made by hand is checked when it is recorded.
    #[must_use]
    pub fn new(config: NetworkConfig) -> Self {
        Self { config }
    }

    /// What fixes it.
    #[must_use]
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// The metric network beside this one, in a nested network.
    #[must_use]
    pub fn metric(&self) -> Option<Self> {
        self.config.metric.as_deref().cloned().map(Self::new)
    }

    /// The choice of reference view that the network was published with.
    #[must_use]
    pub fn default_reference(&self) -> ReferenceChoice {
        match self.config.family {
            Family::DepthAnything3 if self.config.makes_cameras() => ReferenceChoice::SaddleBalanced,
            Family::DepthAnything3 | Family::OmniX => ReferenceChoice::First,
        }
    }

    /// Records the backbone, the camera decoder and, for given cameras, the camera encoder.
    ///
    /// # Errors
    /// [`ModelError::Request`] when the network cannot do what is asked.
    pub fn backbone(&self, g: &mut Graph, spec: &BackboneSpec) -> Result<BackboneOutputs, ModelError> {
        self.config.check()?;
        check_grid(spec.images, spec.grid, "images")?;
        let request = |what: String, cure: String| Err(ModelError::Request { what, cure });
        let name = &self.config.name;
        if let ReferenceChoice::Forced(i) = spec.reference
            && i >= spec.images
        {
            return request(format!("view {i} as the reference"), format!("there are views 0 to {}", spec.images - 1));
        }
        let never_selects = self.config.family == Family::OmniX;
        if never_selects && !matches!(spec.reference, ReferenceChoice::First | ReferenceChoice::Forced(0)) {
            return request(
                format!("{} as the reference view", spec.reference),
                format!("{name} takes the first image"),
            );
        }
        if !self.config.makes_cameras() && spec.reference != ReferenceChoice::First {
            let cure = format!("in {name} each image is by itself; leave it out");
            return request(format!("{} as the reference view", spec.reference), cure);
        }
        if spec.cameras_given && self.config.camera_encoder.is_none() {
            return request("given cameras".to_owned(), format!("{name} has no camera encoder; leave them out"));
        }
        if self.config.backbone.time.is_some() && spec.times.len() != spec.images {
            return Err(self.times_missing(spec.times.len(), spec.images));
        }
        let blocks = self.config.backbone.blocks;
        if let Some(layer) = spec.export_layers.iter().find(|l| **l >= blocks) {
            return request(format!("features of block {layer}"), format!("{name} has blocks 0 to {}", blocks - 1));
        }
        backbone::record(g, &self.config, spec)
    }

    /// Records the head for a chunk of frames.
    ///
    /// # Errors
    /// [`ModelError::Request`] for no frames or an empty grid, or points of a network that makes none.
    pub fn head(&self, g: &mut Graph, spec: &HeadSpec) -> Result<HeadOutputs, ModelError> {
        self.config.check()?;
        check_grid(spec.frames, spec.grid, "frames")?;
        if spec.rays && !self.config.makes_cameras() {
            let cure = format!("{} makes depth and sky; any-view networks make rays", self.config.name);
            return Err(ModelError::Request { what: "ray maps".to_owned(), cure });
        }
        if spec.gaussians && self.config.gaussians.is_none() {
            let cure = format!("{} has no head for them; da3-giant and da3nested-giant-large have", self.config.name);
            return Err(ModelError::Request { what: "Gaussians".to_owned(), cure });
        }
        if spec.points && self.config.family != Family::OmniX {
            let cure = format!("{} makes depth and cameras; OmniX networks make points", self.config.name);
            return Err(ModelError::Request { what: "world points".to_owned(), cure });
        }
        dpt::record(g, &self.config, spec)
    }

    /// Records the spatiotemporal module over all images: features and points to a field.
    ///
    /// # Errors
    /// [`ModelError::Request`] when the network has no such module, or for numbers that do not fit.
    pub fn motion(&self, g: &mut Graph, spec: &MotionSpec) -> Result<MotionOutputs, ModelError> {
        self.motion_with(g, spec, None)
    }

    /// [`Network::motion`], in training with dropout.
    pub(crate) fn motion_with(
        &self,
        g: &mut Graph,
        spec: &MotionSpec,
        dropout: Option<Dropout>,
    ) -> Result<MotionOutputs, ModelError> {
        let trajectory = self.trajectory()?;
        check_grid(spec.images, spec.grid, "images")?;
        if spec.times.len() != spec.images {
            return Err(self.times_missing(spec.times.len(), spec.images));
        }
        motion::record(g, trajectory, self.config.backbone.feature_width(), spec, dropout)
    }

    /// Records the sampling head for a chunk of frames: where their pixels read the field.
    ///
    /// # Errors
    /// As [`Network::motion`].
    pub fn sampling(&self, g: &mut Graph, spec: &SamplingSpec) -> Result<SamplingOutputs, ModelError> {
        let trajectory = self.trajectory()?;
        check_grid(spec.frames, spec.grid, "frames")?;
        check_grid(spec.times, spec.grid, "target times")?;
        sampling::record(g, trajectory, self.config.backbone.feature_width(), spec)
    }

    /// The trajectory module of a configuration that has been checked.
    fn trajectory(&self) -> Result<&TrajectoryConfig, ModelError> {
        self.config.check()?;
        self.config.trajectory.as_ref().ok_or_else(|| ModelError::Request {
            what: "trajectories".to_owned(),
            cure: format!("{} makes geometry only; take an OmniX network with a trajectory module", self.config.name),
        })
    }

    fn times_missing(&self, found: usize, images: usize) -> ModelError {
        let cure = format!("{} needs a video and a frame number for each of {images} images", self.config.name);
        ModelError::Request { what: format!("{found} times"), cure }
    }
}

/// Largest number of patches along one side: 14 times it is far above any texture.
const LONGEST: usize = 1 << 12;

fn check_grid(count: usize, (rows, columns): (usize, usize), what: &str) -> Result<(), ModelError> {
    let fits = |n: usize| (1..=LONGEST).contains(&n);
    if count > 0 && count <= 1 << 20 && fits(rows) && fits(columns) {
        return Ok(());
    }
    let what = format!("{count} {what} of {} x {} pixels", columns.saturating_mul(PATCH), rows.saturating_mul(PATCH));
    Err(ModelError::Request { what, cure: format!("at least one, and sides of {PATCH} to {} pixels", LONGEST * PATCH) })
}
