//! No dispatch is so long that a driver takes a slow GPU for hung: every kernel over the largest shapes of the released networks
//! (DA3-GIANT and OmniX, 64 images of 504 x 280) and beyond.

use omnix_kernels::adamw::AdamW;
use omnix_kernels::attention::Attention;
use omnix_kernels::attention_grad_kv::AttentionGradKv;
use omnix_kernels::attention_grad_q::AttentionGradQ;
use omnix_kernels::conv2d::Conv2d;
use omnix_kernels::conv2d_weights::Conv2dWeights;
use omnix_kernels::copy::{Copy, Strided};
use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::deform_sample_grad::DeformSampleGrad;
use omnix_kernels::deform_sample_grad_field::DeformSampleGradField;
use omnix_kernels::dispatch::MAX_OPERATIONS;
use omnix_kernels::dropout::Dropout;
use omnix_kernels::field_scatter::FieldScatter;
use omnix_kernels::field_scatter_grad::FieldScatterGrad;
use omnix_kernels::fill::Fill;
use omnix_kernels::gather::Gather;
use omnix_kernels::grad_norm::Squares;
use omnix_kernels::layer_norm::LayerNorm;
use omnix_kernels::layer_norm_grad::LayerNormGrad;
use omnix_kernels::linear::Linear;
use omnix_kernels::linear_weights::LinearWeights;
use omnix_kernels::pointwise::{Binary, Operand, Pointwise, Unary};
use omnix_kernels::rank::{Rank, Which};
use omnix_kernels::reduce::{Reduce, ReduceOp};
use omnix_kernels::reference_view::{ReferenceView, Strategy};
use omnix_kernels::resize::{Corners, Filter, Resize};
use omnix_kernels::resize_grad::ResizeGrad;
use omnix_kernels::scatter::Scatter;
use omnix_kernels::softmax::Softmax;
use omnix_kernels::splat::Splat;
use omnix_kernels::split_heads::{HeadLayout, SplitHeads};
use omnix_kernels::split_heads_grad::SplitHeadsGrad;
use omnix_kernels::swiglu::SwiGlu;
use omnix_kernels::swiglu_grad::SwiGluGrad;
use omnix_kernels::token_expand::TokenExpand;
use omnix_kernels::token_expand_grad::TokenExpandGrad;
use omnix_kernels::top_k::TopK;
use omnix_kernels::traj_apply::{Gate, Motion, TrajApply};
use omnix_kernels::traj_apply_grad::TrajApplyGrad;
use omnix_kernels::trajectory::Trajectory;
use omnix_kernels::{Activation, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType};
use omnix_tests::{Trial, trials};

pub(crate) fn trials() -> Vec<Trial> {
    trials!("bounds", once: [products_are_short, what_moves_numbers_is_short])
}

/// Devices that are watched: any WebGPU device, a small GPU, and one that binds everything at once.
fn watched() -> [Caps; 3] {
    let gpu = Caps::baseline().with_tier(Tier::Gpu);
    let large = Caps { max_binding: (4 << 30) - 256, max_buffer: 64 << 30, ..gpu.clone() };
    [Caps::baseline(), gpu, large]
}

/// Checks the dispatches on every watched device; together they do at least the `flops` of the whole.
fn short(what: &str, flops: u64, record: &dyn Fn(&Caps) -> Result<Vec<Dispatch>, KernelError>) {
    for caps in watched() {
        let dispatches = record(&caps).unwrap_or_else(|error| panic!("{what}: {error}"));
        let longest = dispatches.iter().map(|dispatch| dispatch.operations).max().unwrap_or(0);
        assert!(longest > 0, "{what}: no operations counted");
        assert!(longest <= MAX_OPERATIONS, "{what}, bindings of {}: {longest} operations", caps.max_binding);
        let all: u64 = dispatches.iter().map(|dispatch| dispatch.operations).sum();
        assert!(all >= flops, "{what}: {all} operations of {flops}");
    }
}

fn products_are_short() {
    let tokens = 64 * 721;
    // Feed-forward layers and projections of DA3-GIANT, of the trajectory module, and one wide enough to be alone.
    for (m, n, k) in [
        (tokens, 8192, 1536),
        (tokens, 1536, 4096),
        (tokens, 4608, 1536),
        (64 * 64 * 144, 2048, 512),
        (64 * 280 * 504, 2, 32),
        (100_000, 65_536, 16_384),
    ] {
        for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
            let weights = PackedWeights { k, n, storage };
            let spec = Linear { m, weights, act: Activation::Gelu, bias: true, gamma: false, residual: false };
            let fits = |caps: &Caps| u64::from(k.max(n)) * 256 <= caps.max_binding;
            if watched().iter().all(fits) {
                short(&format!("{spec:?}"), spec.flops(), &|caps| spec.record(caps));
            }
        }
    }
    for (frames, ci, co, hi, wi) in [(64, 256, 256, 160, 288), (64, 1024, 256, 20, 36), (1, 128, 64, 2800, 5040)] {
        let spec = Conv2d {
            frames,
            hi,
            wi,
            ci,
            kernel: [3, 3],
            stride: 1,
            padding: 1,
            weights: PackedWeights { k: 9 * ci, n: co, storage: WeightType::F32 },
            act: Activation::Relu,
            relu_input: true,
            bias: true,
            residual: true,
            residual2: false,
        };
        short(&format!("{spec:?}"), spec.flops(), &|caps| spec.record(caps));
    }
    for (m, n, k) in [(tokens, 8192, 1536), (tokens, 1536, 4096), (64 * 280 * 504, 2, 32), (100_000, 65_536, 16_384)] {
        let spec = LinearWeights { m, n, k, bias: true };
        if watched().iter().all(|caps| u64::from(n.max(k)) * 256 <= caps.max_binding) {
            short(&format!("{spec:?}"), spec.flops(), &|caps| spec.record(caps));
        }
    }
    for (frames, ci, co, hi, wi) in [(64, 256, 256, 160, 288), (64, 1024, 256, 20, 36), (1, 128, 64, 2800, 5040)] {
        let spec = Conv2dWeights { frames, hi, wi, ci, co, kernel: [3, 3], stride: 1, padding: 1, bias: true };
        short(&format!("{spec:?}"), spec.flops(), &|caps| spec.record(caps));
    }
    // Global attention, that of queries of all times to one image's tokens, and one with a million keys.
    for (groups, heads, nq, nk) in [(1, 24, tokens, tokens), (64, 8, 64 * 144, 720), (1, 16, 100_000, 1_000_000)] {
        for head_dim in [6, 64, 128] {
            let spec = Attention { groups, heads, head_dim, nq, nk, keep_state: false };
            short(&format!("{spec:?}"), spec.flops(), &|caps| spec.record(caps));
            let (q, kv) = (AttentionGradQ { attention: spec }, AttentionGradKv { attention: spec });
            short(&format!("{q:?}"), q.flops(), &|caps| q.record(caps));
            short(&format!("{kv:?}"), kv.flops(), &|caps| kv.record(caps));
        }
    }
    let sample = DeformSample {
        n: 504 * 280,
        width: 504,
        height: 280,
        hp: 20,
        wp: 36,
        levels: 4,
        points: 9,
        times: 64,
        listed: false,
    };
    short("deform_sample", sample.flops(), &|caps| sample.record(caps));
    let points = DeformSampleGrad(sample);
    short("deform_sample_grad", points.flops(), &|caps| points.record(caps));
    let field = DeformSampleGradField(sample);
    short("deform_sample_grad_field", field.flops(), &|caps| field.record(caps));
    let motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Hard(0.3) };
    let path = Trajectory { sample, nt: 64, motion };
    short("trajectory", path.flops(), &|caps| path.record(caps));
    for (s, c) in [(64, 1536), (8000, 1536)] {
        let flops = 4 * u64::from(s) * u64::from(s) * u64::from(c);
        for strategy in [Strategy::SaddleBalanced, Strategy::SaddleSimRange] {
            let spec = ReferenceView { s, c, strategy };
            short(&format!("{spec:?}"), flops, &|caps| spec.record(caps));
        }
    }
    for [rows, n, k] in [[64, 720, 180], [1, 1_000_000, 1000], [5_000_000, 720, 3]] {
        short("top_k", 0, &|caps| TopK { rows, n, k, flat: false }.record(caps));
    }
}

/// As many numbers as 64 images have at the largest map, and some billions.
fn what_moves_numbers_is_short() {
    let (m, c) = (64 * 280 * 504, 64);
    let n = 4_000_000_000;
    short("pointwise", 0, &|caps| Pointwise::unary(n, Unary::Gelu).record(caps));
    short("pointwise", 0, &|caps| Pointwise::binary(n, Binary::Add, Operand::same(n)).record(caps));
    short("fill", 0, &|caps| Fill::whole(u64::from(n), 0.0).record(caps));
    let shape = [1, 1, 64, 280 * 504, 8, 8];
    let copy = Copy { shape, src: Strided::contiguous(shape), dst: Strided::contiguous(shape) };
    short("copy", 0, &|caps| copy.record(caps));
    let norm = LayerNorm { m, c, eps: 1e-6, act: Activation::None, weight: true, bias: true };
    short("layer_norm", 0, &|caps| norm.record(caps));
    let norm = LayerNormGrad { m, c, eps: 1e-6, weight: true, d_weight: true, d_bias: true };
    short("layer_norm_grad", 0, &|caps| norm.record(caps));
    short("softmax", 0, &|caps| Softmax { m, n: c }.record(caps));
    short("reduce", 0, &|caps| Reduce { outer: m, n: c, inner: 1, op: ReduceOp::Std }.record(caps));
    for (n, inner) in [(n, 1), (m, c)] {
        short("long reduce", 0, &|caps| Reduce { outer: 1, n, inner, op: ReduceOp::Sum }.record(caps));
    }
    let which = Which::Quantile { numerator: 49, denominator: 50 };
    short("rank", 0, &|caps| Rank { rows: 1, n, which }.record(caps));
    let dropout = Dropout { n, p: 0.1, seed: 0, stream: 0 };
    short("dropout", 0, &|caps| dropout.record(caps));
    short("swiglu", 0, &|caps| SwiGlu { m: 64 * 721, h: 4096 }.record(caps));
    short("swiglu_grad", 0, &|caps| SwiGluGrad { m: 64 * 721, h: 4096 }.record(caps));
    let squares = Squares { n: u64::from(n), first: 0, scale: 1.0 };
    short("grad_norm", 0, &|caps| squares.record(caps));
    let step = AdamW { n: u64::from(n), betas: [0.9, 0.95], eps: 1e-8, scale: 1.0, clip: true };
    short("adamw", 0, &|caps| step.record(caps));
    let blend = omnix_kernels::blend::Blend { n: u64::from(n) };
    short("blend", 0, &|caps| blend.record(caps));
    short("gather", 0, &|caps| Gather { n: m, m, c }.record(caps));
    let pack = omnix_tests::cases::pack::linear(4096, 6144, true, WeightType::F32);
    short("pack", 0, &|caps| pack.record(caps));
    short("scatter", 0, &|caps| Scatter { n: m, m, c }.record(caps));
    let splat = Splat { n: 64 * 280 * 504, width: 3840, height: 2160, largest: Splat::LARGEST };
    short("splat", 0, &|caps| splat.record(caps));
    let heads = SplitHeads {
        groups: 64,
        tokens: 721,
        heads: 24,
        head_dim: 64,
        x_stride: 4608,
        x_offset: 0,
        norm: Some(1e-5),
        rope_rows: Some(721),
        scale: 0.125,
        layout: HeadLayout::KeyBlocks,
    };
    short("split_heads", 0, &|caps| heads.record(caps));
    let grad = SplitHeadsGrad { heads, dx_stride: 4608, dx_offset: 0 };
    short("split_heads_grad", 0, &|caps| grad.record(caps));
    let expand = TokenExpand { m: 64 * 144, d: 512, times: 64, scale: true, alpha: true, kappa: true };
    short("token_expand", 0, &|caps| expand.record(caps));
    let expand = TokenExpandGrad { m: 64 * 144, d: 512, times: 64, scale: true, alpha: true, kappa: true };
    short("token_expand_grad", 0, &|caps| expand.record(caps));
    let field = FieldScatter { sources: 64, times: 64, k: 144, cells: 720, c: 9 };
    short("field_scatter", 0, &|caps| field.record(caps));
    let field = FieldScatterGrad { sources: 64, times: 64, k: 144, cells: 720, c: 9 };
    short("field_scatter_grad", 0, &|caps| field.record(caps));
    let motion = Motion { relative: true, min_norm: 1e-3, gate: Gate::Blend };
    short("traj_apply_grad", 0, &|caps| TrajApplyGrad { n: 504 * 280, times: 64, motion, theta: true }.record(caps));
    short("traj_apply", 0, &|caps| TrajApply { n: 504 * 280, times: 64, motion }.record(caps));
    for filter in [Filter::Bilinear, Filter::Bicubic] {
        let resize = Resize {
            frames: 64,
            hi: 160,
            wi: 288,
            ho: 280,
            wo: 504,
            c: 256,
            filter,
            corners: Corners::Align,
            code: false,
        };
        short("resize", 0, &|caps| resize.record(caps));
        short("resize_grad", 0, &|caps| ResizeGrad { resize }.record(caps));
    }
}
