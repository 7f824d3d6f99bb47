//! A network and what can be asked of it.

use omnix_graph::Graph;

use crate::backbone::{self, BackboneOutputs, BackboneSpec, ReferenceChoice};
use crate::config::{Family, NetworkConfig};
use crate::dpt::{self, HeadOutputs, HeadSpec};
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

    /// The choice of reference view that the network was published with.
    #[must_use]
    pub fn default_reference(&self) -> ReferenceChoice {
        match self.config.family {
            Family::DepthAnything3 => ReferenceChoice::SaddleBalanced,
            Family::OmniX => ReferenceChoice::First,
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
                format!("{:?} as the reference view", spec.reference),
                format!("{name} takes the first image"),
            );
        }
        if spec.cameras_given && self.config.camera_encoder.is_none() {
            return request("given cameras".to_owned(), format!("{name} has no camera encoder; leave them out"));
        }
        if self.config.backbone.time.is_some() && spec.times.len() != spec.images {
            let cure = format!("{name} needs a video and a frame number for each of {} images", spec.images);
            return request(format!("{} times", spec.times.len()), cure);
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
    /// [`ModelError::Request`] for no frames or an empty grid.
    pub fn head(&self, g: &mut Graph, spec: &HeadSpec) -> Result<HeadOutputs, ModelError> {
        self.config.check()?;
        check_grid(spec.frames, spec.grid, "frames")?;
        dpt::record(g, &self.config, spec)
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
