//! What the backbone is asked for, and what it gives.

use std::fmt;

use omnix_graph::Value;
use omnix_graph::ops::Strategy;

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

impl fmt::Display for ReferenceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => f.write_str("the first image"),
            Self::Middle => f.write_str("the middle image"),
            Self::SaddleBalanced => f.write_str("the most average image (saddle_balanced)"),
            Self::SaddleSimRange => f.write_str("the image with the widest range of similarities (saddle_sim_range)"),
            Self::Forced(image) => write!(f, "image {image}"),
        }
    }
}

/// What the backbone is asked for.
#[derive(Clone, Debug)]
pub struct BackboneSpec {
    /// Views of the scene, S.
    pub images: usize,
    /// Patch rows and columns; the pictures are `14` times that.
    pub grid: (usize, usize),
    /// Which view is the reference.
    pub reference: ReferenceChoice,
    /// Whether cameras are given, as the input `camera_codes`.
    pub cameras_given: bool,
    /// Video and frame number of every image; networks without time codes do not look at them.
    pub times: Vec<(u32, u32)>,
    /// Blocks whose normalised patch tokens are wanted, in the internal order of views.
    pub export_layers: Vec<usize>,
}

impl BackboneSpec {
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
    /// `feat.0` to `feat.3`: `[S, P, 2C]`, views in their original order; `[S, P, C]` where views do not see each other.
    pub features: [Value; 4],
    /// `cam.pose_enc`: `[S, 9]`, camera-to-world translation, quaternion xyzw, vertical and horizontal field of view; none of a
    /// network without cameras.
    pub pose_codes: Option<Value>,
    /// The reference view.
    pub reference: Reference,
    /// `out.aux.feat_layer_{i}`: `[S, gh, gw, C]` for each of the layers asked for, views in internal order.
    pub exports: Vec<(usize, Value)>,
}

/// The strategy as the kernel knows it, for the choices that need the network.
pub(crate) fn strategy(choice: ReferenceChoice) -> Option<Strategy> {
    match choice {
        ReferenceChoice::SaddleBalanced => Some(Strategy::SaddleBalanced),
        ReferenceChoice::SaddleSimRange => Some(Strategy::SaddleSimRange),
        ReferenceChoice::First | ReferenceChoice::Middle | ReferenceChoice::Forced(_) => None,
    }
}
