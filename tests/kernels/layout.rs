//! Host structs against what naga sees: size, and every member's name and offset.

use omnix_kernels::layout::{HostParams, Layout};
use omnix_kernels::{
    attention, conv2d, copy, deform_sample, field_scatter, gather, layer_norm, linear, pointwise, reduce,
    reference_view, resize, softmax, split_heads, swiglu, token_expand, top_k, traj_apply, winograd,
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
    ("attention", attention::AttentionParams::LAYOUT),
    ("conv2d", conv2d::Conv2dParams::LAYOUT),
    ("copy", copy::CopyParams::LAYOUT),
    ("deform_sample", deform_sample::DeformParams::LAYOUT),
    ("field_scatter", field_scatter::FieldScatterParams::LAYOUT),
    ("gather", gather::RowsParams::LAYOUT),
    ("layer_norm", layer_norm::LayerNormParams::LAYOUT),
    ("linear", linear::LinearParams::LAYOUT),
    ("pointwise", pointwise::PointwiseParams::LAYOUT),
    ("reduce", reduce::ReduceParams::LAYOUT),
    ("reference_view", reference_view::ReferenceViewParams::LAYOUT),
    ("resize", resize::ResizeParams::LAYOUT),
    ("scatter", gather::RowsParams::LAYOUT),
    ("softmax", softmax::SoftmaxParams::LAYOUT),
    ("split_heads", split_heads::SplitHeadsParams::LAYOUT),
    ("swiglu", swiglu::SwiGluParams::LAYOUT),
    ("token_expand", token_expand::TokenExpandParams::LAYOUT),
    ("top_k", top_k::TopKParams::LAYOUT),
    ("traj_apply", traj_apply::TrajApplyParams::LAYOUT),
    ("trajectory", deform_sample::DeformParams::LAYOUT),
    ("winograd", winograd::WinogradParams::LAYOUT),
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
