//! The closed set of operations, one file each: what it is, its shape rule (the method of [`Graph`] that records it), its
//! kernel calls, how it goes in rows, the operations it counts. This file only dispatches.
//!
//! Fused fields (`act`, `gamma`, `residual`, `relu_input`) are filled by [`crate::passes::fuse`]; layers record the parts
//! separately.

mod adamw;
mod attention;
mod attention_grad_kv;
mod attention_grad_q;
mod blend;
mod conv2d;
mod conv2d_weights;
mod conv_transpose2d;
mod copy;
mod deform_sample;
mod deform_sample_grad;
mod deform_sample_grad_field;
mod dropout;
mod field_scatter;
mod field_scatter_grad;
mod fill;
mod gather;
mod grad_norm;
mod layer_norm;
mod layer_norm_grad;
mod linear;
mod linear_weights;
mod pack;
mod pointwise;
mod rank;
mod reduce;
mod reference_view;
mod resize;
mod resize_grad;
mod sampling;
mod scatter;
mod softmax;
mod splat;
mod split_heads;
mod split_heads_grad;
mod swiglu;
mod swiglu_grad;
mod token_expand;
mod token_expand_grad;
mod top_k;
mod traj_apply;
mod traj_apply_grad;
mod trajectory;

pub use omnix_kernels::copy::{Copy as StridedCopy, Strided};
pub use omnix_kernels::pointwise::{Binary, Unary};
pub use omnix_kernels::rank::Which;
pub use omnix_kernels::reduce::ReduceOp;
pub use omnix_kernels::reference_view::Strategy;
pub use omnix_kernels::resize::{Corners, Filter, Ratio};
pub use omnix_kernels::split_heads::HeadLayout;
pub use omnix_kernels::traj_apply::{Gate, Motion};

pub use adamw::AdamW;
pub use attention::Attention;
pub use attention_grad_kv::AttentionGradKv;
pub use attention_grad_q::AttentionGradQ;
pub use blend::Blend;
pub use conv2d::Conv2d;
pub use conv2d_weights::Conv2dWeights;
pub use copy::{Copies, Piece};
pub use deform_sample::DeformSample;
pub use deform_sample_grad::DeformSampleGrad;
pub use deform_sample_grad_field::DeformSampleGradField;
pub use dropout::Dropout;
pub use field_scatter::FieldScatter;
pub use field_scatter_grad::FieldScatterGrad;
pub use fill::Fill;
pub use gather::Gather;
pub use grad_norm::GradNorm;
pub use layer_norm::LayerNorm;
pub use layer_norm_grad::LayerNormGrad;
pub use linear::Linear;
pub use linear_weights::LinearWeights;
pub use pack::Pack;
pub use pointwise::{Map, MapGrad, Operand, Select, Zip};
pub use rank::Rank;
pub use reduce::Reduce;
pub use reference_view::ReferenceView;
pub use resize::Resize;
pub use resize_grad::ResizeGrad;
pub use sampling::Sampling;
pub use scatter::Scatter;
pub use softmax::Softmax;
pub use splat::Splat;
pub use split_heads::{HeadNorm, Heads, SplitHeads, WIDEST_HEAD};
pub use split_heads_grad::SplitHeadsGrad;
pub use swiglu::SwiGlu;
pub use swiglu_grad::SwiGluGrad;
pub use token_expand::{Expand, TokenExpand};
pub use token_expand_grad::{ExpandGrad, TokenExpandGrad};
pub use top_k::TopK;
pub use traj_apply::TrajApply;
pub use traj_apply_grad::TrajApplyGrad;
pub use trajectory::Trajectory;

use omnix_kernels::{KernelError, WeightType};
use smallvec::SmallVec;

use crate::graph::{Call, Operation, Packing, RowWise, Site, Value, Values};

/// A graph of these operations.
pub type Graph = crate::graph::Graph<Op>;
/// A node of such a graph.
pub type Node = crate::graph::Node<Op>;

/// States the set: the enum, and that everything asked of it is answered by the operation.
macro_rules! operations {
    ($($(#[$doc:meta])* $op:ident,)*) => {
        /// One operation with its arguments.
        #[derive(Clone, Debug)]
        pub enum Op {
            $($(#[$doc])* $op($op),)*
        }

        $(impl From<$op> for Op {
            fn from(op: $op) -> Self {
                Self::$op(op)
            }
        })*

        impl Operation for Op {
            fn name(&self) -> &'static str {
                match self { $(Self::$op(op) => op.name(),)* }
            }

            fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
                match self { $(Self::$op(op) => op.map_inputs(map),)* }
            }

            fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
                match self { $(Self::$op(op) => op.lower(site),)* }
            }

            fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
                match self { $(Self::$op(op) => op.flops(values, outputs),)* }
            }

            fn row_wise(&self, values: &Values) -> Option<RowWise> {
                match self { $(Self::$op(op) => op.row_wise(values),)* }
            }

            fn packing(&self, values: &Values, value: Value, storage: WeightType) -> Packing {
                match self { $(Self::$op(op) => op.packing(values, value, storage),)* }
            }

            fn writes(&self) -> SmallVec<[Value; 4]> {
                match self { $(Self::$op(op) => op.writes(),)* }
            }

            fn windowed(&self, outputs: &[Value]) -> SmallVec<[Value; 2]> {
                match self { $(Self::$op(op) => op.windowed(outputs),)* }
            }
        }
    };
}

operations! {
    /// Matrix product with epilogue.
    Linear,
    /// Weights in training, packed for a product.
    Pack,
    /// Layer norm over the last axis.
    LayerNorm,
    /// Split, normalise, rotate (RoPE), scale, lay out.
    SplitHeads,
    /// Attention without a score matrix.
    Attention,
    /// Convolution with epilogue.
    Conv2d,
    /// A map at another height and width.
    Resize,
    /// An output put together from strided pieces.
    Copies,
    /// One constant.
    Fill,
    /// A function of one value, element by element.
    Map,
    /// A function of two values, element by element.
    Zip,
    /// The gradient of a function of one value.
    MapGrad,
    /// The choice between two values, element by element.
    Select,
    /// `silu(a) · b`.
    SwiGlu,
    /// Softmax over the last axis.
    Softmax,
    /// Sum, mean, maximum, minimum or standard deviation over one axis.
    Reduce,
    /// Rows by index.
    Gather,
    /// Rows written by index.
    Scatter,
    /// The k largest of each row.
    TopK,
    /// Which view is the reference.
    ReferenceView,
    /// Every token once for every time.
    TokenExpand,
    /// Tokens at their cells of a field.
    FieldScatter,
    /// A field and a mask at sampling points.
    DeformSample,
    /// Points moved by what was sampled.
    TrajApply,
    /// The last two in one, for a range of times.
    Trajectory,
    /// Points as a camera sees them.
    Splat,
    /// The gradient of `silu(a) · b`.
    SwiGluGrad,
    /// The gradient of tokens under a code of each time.
    TokenExpandGrad,
    /// The gradient of moved points.
    TrajApplyGrad,
    /// The gradient of tokens at their cells of a field.
    FieldScatterGrad,
    /// The gradient of where pixels sample.
    DeformSampleGrad,
    /// The gradient of what pixels sample.
    DeformSampleGradField,
    /// The number of a rank of each row.
    Rank,
    /// Some numbers left out.
    Dropout,
    /// The norm of many gradients and the factor that clips it.
    GradNorm,
    /// One step of AdamW.
    AdamW,
    /// Numbers mixed into others.
    Blend,
    /// Gradients of a linear layer's weights and bias.
    LinearWeights,
    /// Gradients of a convolution's weights and bias.
    Conv2dWeights,
    /// The gradient of an attention's queries.
    AttentionGradQ,
    /// The gradients of an attention's keys and values.
    AttentionGradKv,
    /// The gradients of columns that became heads.
    SplitHeadsGrad,
    /// The gradients of a layer norm.
    LayerNormGrad,
    /// The gradient of a map that was resized.
    ResizeGrad,
}
