//! The trajectory module's configuration (`spec/omnix.md` section 1.1) and its ablation switches.
//!
//! Fields that select between the paper's reading and the release's are enums here. The switches that the release's code
//! still has (section 9) are further fields of `trajectory`, with names of ours, all of them optional and off:
//!
//! | field | value | meaning |
//! |---|---|---|
//! | `temporal_blocks` | block numbers | self-attention over the target times of a token first |
//! | `spatial_blocks` | block numbers | then self-attention over all tokens of a target time |
//! | `no_cross_blocks` | block numbers | no cross attention in these |
//! | `time_gain` | "adaln", "token_adaln" | scale and shift of normalised tokens in place of an added code |
//! | `field` | "translation" | three channels: points shift and do not turn |
//! | `fine_queries`, `fixed_offsets`, `neighbour_damping` | false | refused: no public description is whole |

pub(super) mod check;
pub(super) mod read;

use omnix_graph::ops::{Gate, Motion};

/// Numbers of a rigid field: 6D rotation, translation.
pub(crate) const RIGID: usize = 9;

/// How a target time's code enters the tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeGain {
    /// Added.
    None,
    /// Added, times one number per token (at least 0).
    PerToken,
    /// Scale and shift of the normalised token, both of the time alone.
    AdaLn,
    /// The same, each times one number per token.
    TokenAdaLn,
}

/// Which features tokens are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TokenFeatures {
    /// All four side by side.
    All,
    /// The last alone.
    Last,
}

/// How a number of tokens becomes a whole one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// Down.
    Floor,
    /// To the nearest, halves up.
    Nearest,
    /// Up.
    Ceil,
}

/// What the sampling head is told about motion and samples at pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampledScore {
    /// 1 for chosen tokens, else 0.
    Mask,
    /// The probability itself.
    Score,
}

/// What a field says of a cell and a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// Nine numbers: 6D rotation, translation.
    Rigid,
    /// Three numbers, the translation.
    Translation,
}

impl FieldKind {
    /// Channels that the network makes and embeds.
    #[must_use]
    pub const fn channels(self) -> usize {
        match self {
            Self::Rigid => RIGID,
            Self::Translation => 3,
        }
    }
}

/// What decides whether a pixel moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionGate {
    /// Its sampled score against a threshold.
    Hard {
        /// In inference.
        infer: f32,
        /// In training.
        train: f32,
    },
    /// The sampled score multiplies the displacement.
    Blend,
}

/// The head that says where each pixel samples the field.
#[derive(Clone, Debug, PartialEq)]
pub struct SamplingConfig {
    /// Channels of the fusion chain.
    pub features: usize,
    /// Channels of the four projections.
    pub channels: [usize; 4],
    /// Channels before the last layer.
    pub hidden: usize,
    /// Sampling points of a pixel in each level.
    pub points: usize,
    /// Whether the strongest motion over time is embedded beside mean and spread.
    pub salient_max: bool,
    /// The confidence's exponent is clamped to plus and minus this.
    pub logit_clamp: Option<f32>,
}

/// The spatiotemporal module and the head behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryConfig {
    /// Channels of a token, d.
    pub width: usize,
    /// Attention heads.
    pub heads: usize,
    /// Number of blocks.
    pub blocks: usize,
    /// Hidden width of a block over the width.
    pub mlp_ratio: usize,
    /// Whether queries and keys are normalised head by head.
    pub qk_norm: bool,
    /// Base of RoPE, if queries and keys turn with their place at all.
    pub rope_base: Option<f64>,
    /// Whether branches are scaled channel by channel.
    pub layer_scale: bool,
    /// Eps of the norms.
    pub norm_eps: f32,
    /// What tokens are made of.
    pub token_features: TokenFeatures,
    /// Whether the patch's world points enter the token.
    pub token_points: bool,
    /// Base of the time codes.
    pub time_base: f64,
    /// How they enter.
    pub time_gain: TimeGain,
    /// Share of an image's tokens that are followed through time.
    pub top_fraction: f64,
    /// How that becomes a whole number.
    pub top_rounding: Rounding,
    /// Blocks whose queries see the image of their target time alone.
    pub same_time_blocks: Vec<usize>,
    /// Blocks after which a field level is read off, one per level.
    pub field_blocks: Vec<usize>,
    /// What the field holds where no token was chosen.
    pub field_rest: [f32; RIGID],
    /// What a field says.
    pub field: FieldKind,
    /// Floor under the norms of the 6D rotation.
    pub rotation_min_norm: f32,
    /// Whether motion is relative to the image's own time.
    pub relative_to_own_time: bool,
    /// What is sampled as a pixel's score.
    pub sampled_score: SampledScore,
    /// What the score decides.
    pub gate: MotionGate,
    /// The sampling head.
    pub head: SamplingConfig,
    /// Blocks with self-attention over target times.
    pub temporal_blocks: Vec<usize>,
    /// Blocks with self-attention over the tokens of a target time.
    pub spatial_blocks: Vec<usize>,
    /// Blocks without cross attention.
    pub no_cross_blocks: Vec<usize>,
}

impl TrajectoryConfig {
    /// Field levels, M.
    #[must_use]
    pub fn levels(&self) -> usize {
        self.field_blocks.len()
    }

    /// Sampling points of a pixel over all levels.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.levels() * self.head.points
    }

    /// Channels of an attention head.
    #[must_use]
    pub fn head_dim(&self) -> usize {
        self.width / self.heads
    }

    /// Tokens of an image with `patches` of them that are followed: at least one, at most all.
    #[must_use]
    pub fn chosen(&self, patches: usize) -> usize {
        let share = patches as f64 * self.top_fraction;
        let whole = match self.top_rounding {
            Rounding::Floor => share.trunc(),
            Rounding::Nearest => share.round(),
            Rounding::Ceil => share.ceil(),
        };
        (whole as usize).clamp(1, patches)
    }

    /// How points move in inference.
    #[must_use]
    pub fn motion(&self) -> Motion {
        let gate = match self.gate {
            MotionGate::Hard { infer, .. } => Gate::Hard(infer),
            MotionGate::Blend => Gate::Blend,
        };
        Motion { relative: self.relative_to_own_time, min_norm: self.rotation_min_norm, gate }
    }

    /// Hidden widths of the two perceptrons that make one number of a token.
    pub(crate) fn scalar_widths(&self) -> [usize; 2] {
        [self.width / 2, (self.width / 4).max(32)]
    }
}
