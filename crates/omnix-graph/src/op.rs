//! The closed set of operations.
//!
//! Each can be stated in terms of the others when it is differentiated (a linear layer by linear layers over
//! transposed copies, a gather by a scatter, a fused epilogue by its parts), so that a training graph is made of
//! the same nodes. Fused fields (`act`, `gamma`, `residual`, `relu_input`) are filled by [`crate::fuse`]; layers record
//! the parts separately.

mod motion;

use omnix_kernels::Activation;
use smallvec::SmallVec;

pub use motion::{Gate, Motion, Sampling, Trajectory};

pub use omnix_kernels::copy::{Copy as StridedCopy, Strided};
pub use omnix_kernels::pointwise::{Binary, Unary};
pub use omnix_kernels::reduce::ReduceOp;
pub use omnix_kernels::reference_view::Strategy;
pub use omnix_kernels::resize::{Corners, Filter, Ratio};
pub use omnix_kernels::split_heads::HeadLayout;

use crate::graph::Value;

/// How a parameter is packed for the matrix product that reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WeightForm {
    /// `[out, in]`: column n is row n.
    Linear,
    /// `[out, in, rows, columns]` of a convolution: depth in the order (row, column, in).
    Conv,
    /// `[out, in, 3, 3]` transformed for Winograd's algorithm: depth in the order (place, in), `winograd::PLACES` places.
    Winograd,
    /// `[in, out, k, k]` of a transposed convolution with stride k: columns in the order (row, column, out).
    ConvTranspose,
}

/// `y = residual + gamma · act(x Wᵀ + bias)`, rows × depth by depth × columns.
#[derive(Clone, Debug)]
pub struct Linear {
    /// `[.., k]`.
    pub x: Value,
    /// A parameter of `form`.
    pub w: Value,
    /// How `w` is packed.
    pub form: WeightForm,
    /// `[n]`.
    pub bias: Option<Value>,
    /// Fused activation.
    pub act: Activation,
    /// Fused layer scale `[n]`.
    pub gamma: Option<Value>,
    /// Fused addition, of the output's shape.
    pub residual: Option<Value>,
}

/// A head-major tensor out of some columns of rows of tokens: see `omnix_kernels::split_heads`.
#[derive(Clone, Debug)]
pub struct SplitHeads {
    /// `[groups · tokens, width]`.
    pub x: Value,
    /// First column.
    pub offset: usize,
    /// Sequences that do not see each other.
    pub groups: usize,
    /// Tokens of one.
    pub tokens: usize,
    /// Heads.
    pub heads: usize,
    /// Channels of a head.
    pub head_dim: usize,
    /// Layer norm over the channels of a head: weight, bias, eps.
    pub norm: Option<(Value, Value, f32)>,
    /// RoPE table `[rows, head_dim]`: cosines then sines.
    pub rope: Option<Value>,
    /// Applied last.
    pub scale: f32,
    /// What the attention reads it as.
    pub layout: HeadLayout,
}

/// `softmax(q kᵀ) v` a group and head; the scores are never stored.
#[derive(Clone, Debug)]
pub struct Attention {
    /// Scaled queries, `HeadLayout::Rows`.
    pub q: Value,
    /// Keys, `HeadLayout::KeyBlocks`.
    pub k: Value,
    /// Values, `HeadLayout::Rows`.
    pub v: Value,
    /// Sequences that do not see each other.
    pub groups: usize,
    /// Queries of one.
    pub queries: usize,
    /// Keys of one.
    pub keys: usize,
    /// Heads.
    pub heads: usize,
    /// Channels of a head.
    pub head_dim: usize,
}

/// A convolution over `[frame, row, column, channel]`.
#[derive(Clone, Debug)]
pub struct Conv2d {
    /// Input map.
    pub x: Value,
    /// A parameter `[out, in, rows, columns]`.
    pub w: Value,
    /// How `w` is packed, which says by what algorithm the node is computed: [`WeightForm::Conv`] until a plan decides.
    pub form: WeightForm,
    /// `[out]`.
    pub bias: Option<Value>,
    /// Step in rows and columns.
    pub stride: usize,
    /// Zeros around the input.
    pub padding: usize,
    /// Fused: the input passes a ReLU.
    pub relu_input: bool,
    /// Fused activation.
    pub act: Activation,
    /// Fused additions, of the output's shape.
    pub residuals: [Option<Value>; 2],
}

/// The second operand of a pointwise operation: element `i` pairs with `value[(i / div) % len]`.
#[derive(Clone, Copy, Debug)]
pub struct Operand {
    /// The operand.
    pub value: Value,
    /// Repeats of one element.
    pub div: usize,
    /// Elements until it starts again.
    pub len: usize,
}

/// One operation with its arguments.
#[derive(Clone, Debug)]
pub enum Op {
    /// Matrix product with epilogue.
    Linear(Linear),
    /// `act((x - mean) / sqrt(var + eps) · weight + bias)` over the last axis.
    LayerNorm {
        /// `[.., c]`.
        x: Value,
        /// `[c]`.
        weight: Option<Value>,
        /// `[c]`.
        bias: Option<Value>,
        /// Added to the variance.
        eps: f32,
        /// Fused activation.
        act: Activation,
    },
    /// Split, normalise, rotate (RoPE), scale, lay out.
    SplitHeads(SplitHeads),
    /// Attention without a score matrix.
    Attention(Attention),
    /// Convolution with epilogue.
    Conv2d(Conv2d),
    /// `[f, h, w, c]` to another height and width, plus an optional code of columns and rows.
    Resize {
        /// Input map.
        x: Value,
        /// Bilinear or bicubic.
        filter: Filter,
        /// Where the corners go.
        corners: Corners,
        /// Added to every frame: `[w + h, c/2]`, see `omnix_kernels::resize`.
        code: Option<Value>,
    },
    /// An output put together from strided pieces that cover it.
    Copy {
        /// Source and geometry of each piece.
        pieces: Vec<(Value, StridedCopy)>,
    },
    /// `op(x)` element by element.
    Unary {
        /// What to compute.
        op: Unary,
        /// Operand.
        x: Value,
    },
    /// `op(a, b)` element by element.
    Binary {
        /// What to compute.
        op: Binary,
        /// First operand; the output's shape.
        a: Value,
        /// Second operand.
        b: Operand,
    },
    /// `silu(x[:, ..h]) · x[:, h..]`.
    SwiGlu {
        /// `[.., 2h]`.
        x: Value,
    },
    /// Over the last axis.
    Softmax {
        /// `[.., n]`.
        x: Value,
    },
    /// Over the middle axis of `[outer, n, inner]`.
    Reduce {
        /// Input.
        x: Value,
        /// Sum, mean, maximum, minimum or standard deviation.
        op: ReduceOp,
        /// `[outer, n, inner]`.
        dims: [usize; 3],
    },
    /// `y[r] = x[index[r]]`, whole rows.
    Gather {
        /// `[n, ..]`.
        x: Value,
        /// u32 `[m]`.
        index: Value,
    },
    /// `base` with `y[index[r]] = x[r]`.
    Scatter {
        /// What the other rows keep.
        base: Value,
        /// `[m, ..]`.
        x: Value,
        /// u32 `[m]`.
        index: Value,
    },
    /// Indices (u32, ascending) and mask of the k largest of each row.
    TopK {
        /// `[rows, n]`.
        x: Value,
        /// How many.
        k: usize,
        /// Whether indices count over all rows (plus row · n).
        flat: bool,
    },
    /// Order of views with the reference first, its inverse, and the reference's index (u32 each).
    ReferenceView {
        /// Class tokens `[views, c]`.
        x: Value,
        /// How to choose.
        strategy: Strategy,
    },
    /// `z[t, r] = q[r] · (1 + alpha[r] · scale[t]) + kappa[r] · shift[t]`: every row once for every time.
    TokenExpand {
        /// `[m, d]`.
        q: Value,
        /// `[T, d]`, else 0.
        scale: Option<Value>,
        /// `[T, d]`.
        shift: Value,
        /// m numbers, else 1.
        alpha: Option<Value>,
        /// m numbers, else 1.
        kappa: Option<Value>,
    },
    /// `field[s, t, index[s, i]] = z[t, s, i]`, `rest` elsewhere.
    FieldScatter {
        /// `[T, S, K, c]`.
        z: Value,
        /// u32 `[S, K]`, ascending.
        index: Value,
        /// `[c]`.
        rest: Value,
    },
    /// Field and mask of an image at its pixels' sampling points.
    DeformSample(Sampling),
    /// Points moved by what `DeformSample` made, and their scores.
    TrajApply {
        /// `[n, 9 T + 1]`.
        tau: Value,
        /// `[n, 3]`.
        points: Value,
        /// u32; the first is the image's own time.
        when: Value,
        /// How points move.
        motion: Motion,
    },
    /// The two above in one, for a range of times.
    Trajectory(Trajectory),
}

impl Op {
    /// The operation's name in messages, plans and traces.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Linear(_) => "linear",
            Self::LayerNorm { .. } => "layer_norm",
            Self::SplitHeads(_) => "split_heads",
            Self::Attention(_) => "attention",
            Self::Conv2d(_) => "conv2d",
            Self::Resize { .. } => "resize",
            Self::Copy { .. } => "copy",
            Self::Unary { .. } | Self::Binary { .. } => "pointwise",
            Self::SwiGlu { .. } => "swiglu",
            Self::Softmax { .. } => "softmax",
            Self::Reduce { .. } => "reduce",
            Self::Gather { .. } => "gather",
            Self::Scatter { .. } => "scatter",
            Self::TopK { .. } => "top_k",
            Self::ReferenceView { .. } => "reference_view",
            Self::TokenExpand { .. } => "token_expand",
            Self::FieldScatter { .. } => "field_scatter",
            Self::DeformSample(_) => "deform_sample",
            Self::TrajApply { .. } => "traj_apply",
            Self::Trajectory(_) => "trajectory",
        }
    }

    /// Every value the operation reads, parameters and constants included.
    #[must_use]
    pub fn inputs(&self) -> SmallVec<[Value; 8]> {
        let mut copy = self.clone();
        let mut found = SmallVec::new();
        copy.map_inputs(&mut |v| {
            found.push(v);
            v
        });
        found
    }

    /// Replaces every value the operation reads.
    pub fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let mut all = |values: &mut [&mut Value]| values.iter_mut().for_each(|v| **v = map(**v));
        match self {
            Self::Linear(Linear { x, w, bias, gamma, residual, .. }) => {
                all(&mut [x, w]);
                bias.iter_mut().chain(gamma).chain(residual).for_each(|v| all(&mut [v]));
            }
            Self::LayerNorm { x, weight, bias, .. } => {
                all(&mut [x]);
                weight.iter_mut().chain(bias).for_each(|v| all(&mut [v]));
            }
            Self::SplitHeads(SplitHeads { x, norm, rope, .. }) => {
                all(&mut [x]);
                if let Some((w, b, _)) = norm {
                    all(&mut [w, b]);
                }
                rope.iter_mut().for_each(|v| all(&mut [v]));
            }
            Self::Attention(Attention { q, k, v, .. }) => all(&mut [q, k, v]),
            Self::Conv2d(Conv2d { x, w, bias, residuals, .. }) => {
                all(&mut [x, w]);
                bias.iter_mut().chain(residuals.iter_mut().flatten()).for_each(|v| all(&mut [v]));
            }
            Self::Resize { x, code, .. } => {
                all(&mut [x]);
                code.iter_mut().for_each(|v| all(&mut [v]));
            }
            Self::Copy { pieces } => pieces.iter_mut().for_each(|(v, _)| all(&mut [v])),
            Self::Binary { a, b, .. } => all(&mut [a, &mut b.value]),
            Self::Unary { x, .. }
            | Self::SwiGlu { x }
            | Self::Softmax { x }
            | Self::Reduce { x, .. }
            | Self::TopK { x, .. }
            | Self::ReferenceView { x, .. } => {
                all(&mut [x]);
            }
            Self::Gather { x, index } => all(&mut [x, index]),
            Self::Scatter { base, x, index } => all(&mut [base, x, index]),
            Self::TokenExpand { q, scale, shift, alpha, kappa } => {
                all(&mut [q, shift]);
                scale.iter_mut().chain(alpha).chain(kappa).for_each(|v| all(&mut [v]));
            }
            Self::FieldScatter { z, index, rest } => all(&mut [z, index, rest]),
            Self::DeformSample(sampling) => sampling.map_inputs(map),
            Self::TrajApply { tau, points, when, .. } => all(&mut [tau, points, when]),
            Self::Trajectory(t) => {
                all(&mut [&mut t.points, &mut t.when]);
                t.sampling.map_inputs(map);
            }
        }
    }
}
