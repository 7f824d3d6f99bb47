//! A network and what can be asked of it.

use omnix_graph::op::Strategy;
use omnix_graph::{Graph, Value};

use crate::config::{Family, NetworkConfig};
use crate::{ModelError, PATCH, backbone, dpt};

/// How the reference view is found among three or more views without given cameras (`spec/da3.md` section 5).
/// OmniX's is always the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReferenceChoice {
    /// View 0.
    First,
    /// View `S / 2`.
    Middle,
    /// The most average view, by similarity, length and spread of the class tokens.
    #[default]
    SaddleBalanced,
    /// The view with the widest range of similarities; ties are decided by rounding.
    SaddleSimRange,
    /// This view.
    Forced(usize),
}

/// What the backbone is asked for.
#[derive(Clone, Debug)]
pub struct BackboneSpec<'a> {
    /// Views of the scene, S.
    pub images: usize,
    /// Patch rows and columns; the pictures are `14` times that.
    pub grid: (usize, usize),
    /// Which view is the reference.
    pub reference: ReferenceChoice,
    /// Whether cameras are given, as the input `camera_codes`.
    pub cameras_given: bool,
    /// Video and frame number of every image; networks with time codes need them, others do not look.
    pub times: Option<&'a [(u32, u32)]>,
    /// Blocks whose normalised patch tokens are wanted, in the internal order of views.
    pub export_layers: Vec<usize>,
}

impl BackboneSpec<'_> {
    /// Patches of an image, P.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.grid.0 * self.grid.1
    }

    /// Tokens of an image, T = P + 1.
    #[must_use]
    pub fn tokens(&self) -> usize {
        self.patches() + 1
    }
}

/// Which view became the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// This one.
    Known(usize),
    /// The network picks it: the u32 output `ref.index`.
    Selected(Value),
}

/// The outputs of a recorded backbone; all are declared as outputs of the graph.
#[derive(Clone, Debug)]
pub struct BackboneOutputs {
    /// The input `images` `[S, 3, H, W]`: normalised, planar.
    pub images: Value,
    /// The input `camera_codes` `[S, 9]`, when cameras are given.
    pub camera_codes: Option<Value>,
    /// `feat.0` to `feat.3`: `[S, P, 2C]`, views in their original order.
    pub features: [Value; 4],
    /// `cam.pose_enc`: `[S, 9]`, camera-to-world translation, quaternion xyzw, vertical and horizontal field of view.
    pub pose_codes: Value,
    /// The reference view.
    pub reference: Reference,
    /// `out.aux.feat_layer_{i}`: `[S, gh, gw, C]` for each of the layers asked for, views in internal order.
    pub exports: Vec<(usize, Value)>,
}

/// What the head is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeadSpec {
    /// Frames of this chunk.
    pub frames: usize,
    /// Patch rows and columns.
    pub grid: (usize, usize),
    /// Whether ray maps are wanted; they double the work.
    pub rays: bool,
}

/// The outputs of a recorded head; all are declared as outputs of the graph.
#[derive(Clone, Debug)]
pub struct HeadOutputs {
    /// The inputs `feat.0` to `feat.3`: `[frames, P, 2C]`.
    pub features: [Value; 4],
    /// `depth`: `[frames, H, W]`, along the camera's axis.
    pub depth: Value,
    /// `depth_conf`: `[frames, H, W]`, at least 1.
    pub confidence: Value,
    /// `ray`: `[frames, 8gh, 8gw, 6]`, direction then origin; `ray_conf`: `[frames, 8gh, 8gw]`.
    pub rays: Option<(Value, Value)>,
}

/// A network that records itself into graphs.
#[derive(Clone, Debug)]
pub struct Network {
    config: NetworkConfig,
}

impl Network {
    /// The network of a configuration.
    ///
    /// # Errors
    /// When its numbers do not go together ([`NetworkConfig::check`]).
    pub fn new(config: NetworkConfig) -> Result<Self, ModelError> {
        config.check()?;
        Ok(Self { config })
    }

    /// What fixes it.
    #[must_use]
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// Records the backbone, the camera decoder and, for given cameras, the camera encoder.
    ///
    /// # Errors
    /// [`ModelError::Request`] when the network cannot do what is asked.
    pub fn backbone(&self, g: &mut Graph, spec: &BackboneSpec<'_>) -> Result<BackboneOutputs, ModelError> {
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
            return request(format!("{:?} as the reference view", spec.reference), format!("{name} takes the first image"));
        }
        if spec.cameras_given && self.config.camera_encoder.is_none() {
            return request("given cameras".to_owned(), format!("{name} has no camera encoder; leave them out"));
        }
        if self.config.backbone.time.is_some() {
            let cure = || format!("{name} needs a video and a frame number for each of {} images", spec.images);
            match spec.times {
                None => return request("a run without times".to_owned(), cure()),
                Some(times) if times.len() != spec.images => return request(format!("{} times", times.len()), cure()),
                Some(_) => {}
            }
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
    let what = format!("{count} {what} of {} x {} pixels", columns * PATCH, rows * PATCH);
    Err(ModelError::Request { what, cure: format!("at least one, and sides of {PATCH} to {} pixels", LONGEST * PATCH) })
}

/// The strategy as the kernel knows it, for the choices that need the network.
pub(crate) fn strategy(choice: ReferenceChoice) -> Option<Strategy> {
    match choice {
        ReferenceChoice::SaddleBalanced => Some(Strategy::SaddleBalanced),
        ReferenceChoice::SaddleSimRange => Some(Strategy::SaddleSimRange),
        ReferenceChoice::First | ReferenceChoice::Middle | ReferenceChoice::Forced(_) => None,
    }
}
