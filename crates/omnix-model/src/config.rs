//! What fixes a network: widths, blocks, where attention alternates, the head's channels.
//!
//! Two file formats lead here ([`NetworkConfig::from_json`]): the `config.json` published with Depth Anything 3
//! (`spec/da3.md` section 12: a known `model_name`, else the tree under `config`) and `omnix-1` (`spec/omnix.md` section
//! 1.1). Every value is checked before a graph is recorded; complaints name the field, its value and what may be there.

use omnix_weights::Scope;

mod check;
mod da3;
mod fields;
mod json;
mod need;
mod omnix;
mod trajectory;

pub(crate) use trajectory::RIGID;
pub use trajectory::{
    FieldKind, MotionGate, Rounding, SampledScore, SamplingConfig, TimeGain, TokenFeatures, TrajectoryConfig,
};

/// Which published design a network follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Depth Anything 3, any view: the reference view is selected.
    DepthAnything3,
    /// OmniX: the first image is the reference; time codes; clamped exponents.
    OmniX,
}

/// The feed-forward layer of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedForward {
    /// `fc2(gelu(fc1 x))`.
    Mlp {
        /// Width between the two.
        hidden: usize,
    },
    /// `w3(silu(a) · b)`, `(a | b)` the halves of `w12 x`.
    SwiGlu {
        /// Width of a half.
        hidden: usize,
    },
}

impl FeedForward {
    /// The SwiGLU of a width: hidden `8 · ceil(trunc(ratio · width · 2/3) / 8)`.
    #[must_use]
    pub const fn swiglu(width: usize, ratio: usize) -> Self {
        Self::SwiGlu { hidden: (ratio * width * 2 / 3).div_ceil(8) * 8 }
    }
}

/// Time codes added to all tokens before a block (OmniX).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeConfig {
    /// Before this block.
    pub from: usize,
    /// Base of the frequencies.
    pub base: f64,
}

/// The encoder.
#[derive(Clone, Debug, PartialEq)]
pub struct BackboneConfig {
    /// Channels of a token.
    pub width: usize,
    /// Number of blocks.
    pub blocks: usize,
    /// Attention heads.
    pub heads: usize,
    /// Feed-forward layer.
    pub ffn: FeedForward,
    /// Side of the stored position table.
    pub position_grid: usize,
    /// Blocks whose outputs are the four features, counted from 0.
    pub out_layers: [usize; 4],
    /// From this block on, odd blocks attend over all views; the camera token enters before it. None where each view is by itself
    /// (monocular and metric networks): such a network has no cameras, and its features are the blocks' own outputs alone.
    pub alternate_from: Option<usize>,
    /// First block with a norm on queries and keys.
    pub qk_norm_from: Option<usize>,
    /// First block with RoPE.
    pub rope_from: Option<usize>,
    /// Base of RoPE's frequencies.
    pub rope_base: f64,
    /// Time codes, if it has any.
    pub time: Option<TimeConfig>,
}

impl BackboneConfig {
    /// Channels of a head.
    #[must_use]
    pub fn head_dim(&self) -> usize {
        self.width / self.heads
    }

    /// Whether block `i` attends over all views.
    #[must_use]
    pub fn is_global(&self, i: usize) -> bool {
        self.alternate_from.is_some_and(|from| i >= from) && i % 2 == 1
    }

    /// Channels of a feature: the last local block's output beside the block's own, where views see each other.
    #[must_use]
    pub fn feature_width(&self) -> usize {
        if self.alternate_from.is_some() { 2 * self.width } else { self.width }
    }
}

/// What a dense head makes beside depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadKind {
    /// Confidence, and rays in a branch of their own (DualDPT).
    Dual {
        /// Convolutions between the ray branch's fusion chain and its output.
        aux_convs: usize,
    },
    /// How much each pixel is sky (DPT).
    Sky,
}

/// The dense head.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadConfig {
    /// What it makes.
    pub kind: HeadKind,
    /// Channels of the fusion chains.
    pub features: usize,
    /// Channels of the four projections.
    pub channels: [usize; 4],
    /// Exponents of depth and confidence are clamped to plus and minus this.
    pub logit_clamp: Option<f32>,
}

/// The camera encoder for given cameras; its width is the backbone's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraEncoderConfig {
    /// Number of blocks.
    pub blocks: usize,
    /// Attention heads, whatever the width.
    pub heads: usize,
    /// Hidden width of the blocks over the width.
    pub mlp_ratio: usize,
}

impl Default for CameraEncoderConfig {
    fn default() -> Self {
        Self { blocks: 4, heads: 16, mlp_ratio: 4 }
    }
}

/// Where world points come from (OmniX).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointsFrom {
    /// Ray maps: origin + depth · direction.
    Rays,
    /// Depth, intrinsics and pose.
    Camera,
}

/// What depth is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthUnit {
    /// The network's own unit: no metre.
    Own,
    /// Metres, if the focal length were 300 pixels of the picture that the network sees: metres are `depth · f / 300`.
    Canonical,
    /// Metres.
    Metres,
}

/// The Gaussian head (of da3-giant): a DPT chain of its own on the features, joined with the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GaussianConfig {
    /// Channels of the fusion chain.
    pub features: usize,
    /// Channels of the four projections.
    pub channels: [usize; 4],
}

/// A whole network.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkConfig {
    /// For messages and manifests: `da3-small`, `omnix`, or what the file says.
    pub name: String,
    /// The design it follows.
    pub family: Family,
    /// The prefix of the tensors' names, where the configuration says it.
    pub key_prefix: Option<String>,
    /// Where its tensors are among the logical names: at the root, or those of [`omnix_weights::METRIC`].
    pub at: Scope,
    /// The encoder.
    pub backbone: BackboneConfig,
    /// Depth, confidence and rays.
    pub head: HeadConfig,
    /// For given cameras, if it has one.
    pub camera_encoder: Option<CameraEncoderConfig>,
    /// Where world points come from.
    pub points: PointsFrom,
    /// Trajectories, if it makes any.
    pub trajectory: Option<TrajectoryConfig>,
    /// What depth is measured in.
    pub unit: DepthUnit,
    /// The metric network that runs beside it and gives its results the metre and the sky (nested networks).
    pub metric: Option<Box<NetworkConfig>>,
    /// Gaussians, if it makes any.
    pub gaussians: Option<GaussianConfig>,
}

impl NetworkConfig {
    /// Whether it makes cameras, confidence and rays; those that do not make depth and sky, each view by itself.
    #[must_use]
    pub fn makes_cameras(&self) -> bool {
        matches!(self.head.kind, HeadKind::Dual { .. })
    }

    /// Whether results depend on the sky of all views together: it, or its metric network, makes sky.
    #[must_use]
    pub fn makes_sky(&self) -> bool {
        self.head.kind == HeadKind::Sky || self.metric.is_some()
    }

    /// The prefix of the tensors' names, where the configuration says it.
    #[must_use]
    pub fn key_prefix(&self) -> Option<&str> {
        self.key_prefix.as_deref()
    }
}
