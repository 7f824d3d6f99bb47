//! Host structs against what naga sees: size, and every member's name and offset.

use omnix_kernels::layout::{HostParams, Layout};
use omnix_kernels::{
    adamw, attention, attention_grad_q, blend, conv2d, conv2d_weights, copy, deform_sample, dropout, field_scatter,
    field_scatter_grad, fill, gather, grad_norm, layer_norm, layer_norm_grad, linear, linear_weights, pack, pointwise,
    rank, reduce, reference_view, resize, resize_grad, softmax, splat, split_heads, split_heads_grad, swiglu,
    swiglu_grad, token_expand, token_expand_grad, top_k, traj_apply, traj_apply_grad, winograd,
};
use omnix_shaders::ALL;
use omnix_tests::{Trial, trials};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "layout",
        once: [host_params_have_the_layout_naga_reports, params_fit_one_stride_and_no_shader_exceeds_the_baseline],
    )
}

/// The host's `Params` of every kernel.
const HOST: &[(&str, Layout)] = &[
    ("adamw", adamw::AdamWParams::LAYOUT),
    ("attention", attention::AttentionParams::LAYOUT),
    ("attention_grad_kv", attention_grad_q::AttentionGradParams::LAYOUT),
    ("attention_grad_q", attention_grad_q::AttentionGradParams::LAYOUT),
    ("blend", blend::BlendParams::LAYOUT),
    ("conv2d", conv2d::Conv2dParams::LAYOUT),
    ("conv2d_weights", conv2d_weights::Conv2dWeightsParams::LAYOUT),
    ("copy", copy::CopyParams::LAYOUT),
    ("deform_sample", deform_sample::DeformParams::LAYOUT),
    ("deform_sample_grad", deform_sample::DeformParams::LAYOUT),
    ("deform_sample_grad_field", deform_sample::DeformParams::LAYOUT),
    ("dropout", dropout::DropoutParams::LAYOUT),
    ("field_scatter", field_scatter::FieldScatterParams::LAYOUT),
    ("field_scatter_grad", field_scatter_grad::FieldScatterGradParams::LAYOUT),
    ("fill", fill::FillParams::LAYOUT),
    ("gather", gather::RowsParams::LAYOUT),
    ("grad_norm", grad_norm::GradNormParams::LAYOUT),
    ("layer_norm", layer_norm::LayerNormParams::LAYOUT),
    ("layer_norm_grad", layer_norm_grad::LayerNormGradParams::LAYOUT),
    ("linear", linear::LinearParams::LAYOUT),
    ("pack", pack::PackParams::LAYOUT),
    ("linear_weights", linear_weights::LinearWeightsParams::LAYOUT),
    ("pointwise", pointwise::PointwiseParams::LAYOUT),
    ("rank", rank::RankParams::LAYOUT),
    ("reduce", reduce::ReduceParams::LAYOUT),
    ("reference_view", reference_view::ReferenceViewParams::LAYOUT),
    ("resize", resize::ResizeParams::LAYOUT),
    ("resize_grad", resize_grad::ResizeGradParams::LAYOUT),
    ("scatter", gather::RowsParams::LAYOUT),
    ("softmax", softmax::SoftmaxParams::LAYOUT),
    ("splat", splat::SplatParams::LAYOUT),
    ("split_heads", split_heads::SplitHeadsParams::LAYOUT),
    ("split_heads_grad", split_heads_grad::SplitHeadsGradParams::LAYOUT),
    ("swiglu", swiglu::SwiGluParams::LAYOUT),
    ("swiglu_grad", swiglu_grad::SwiGluGradParams::LAYOUT),
    ("token_expand", token_expand::TokenExpandParams::LAYOUT),
    ("token_expand_grad", token_expand_grad::TokenExpandGradParams::LAYOUT),
    ("top_k", top_k::TopKParams::LAYOUT),
    ("traj_apply", traj_apply::TrajApplyParams::LAYOUT),
    ("traj_apply_grad", traj_apply_grad::TrajApplyGradParams::LAYOUT),
    ("trajectory", deform_sample::DeformParams::LAYOUT),
    ("winograd", winograd::WinogradParams::LAYOUT),
    ("winograd_weights", winograd::WinogradParams::LAYOUT),
];

fn host_params_have_the_layout_naga_reports() {
    for shader in ALL {
        let name = format!("{}/{}", shader.kernel, shader.variant);
        let (_, host) = HOST
            .iter()
            .find(|(kernel, _)| *kernel == shader.kernel)
            .unwrap_or_else(|| panic!("{name} is missing from the table in tests/kernels/layout.rs"));
        let members: Vec<(&str, usize)> = shader.params.iter().map(|(n, offset)| (*n, *offset as usize)).collect();
        assert_eq!(members, host.members, "{name}");
        assert_eq!(shader.params_size as usize, host.size, "{name}");
    }
}

fn params_fit_one_stride_and_no_shader_exceeds_the_baseline() {
    for shader in ALL {
        let name = format!("{}/{}", shader.kernel, shader.variant);
        assert!(shader.params_size <= 256, "{name}: Params of {} bytes", shader.params_size);
        let storage = shader.bindings.iter().filter(|b| b.access != omnix_shaders::Access::Uniform).count();
        assert!(storage <= 8, "{name}: {storage} storage buffers, WebGPU offers 8");
    }
    assert!(ALL.len() > 5, "the table lists {} shaders", ALL.len());
}
