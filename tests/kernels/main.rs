//! Every kernel, every variant the device can run, against its oracle over many shapes: a trial for each test and family of
//! variants (`omnix_tests::trials`).

mod adamw;
mod attention;
mod attention_grad_kv;
mod attention_grad_q;
mod blend;
mod bounds;
mod conv2d;
mod conv2d_weights;
mod copy;
mod deform_sample;
mod deform_sample_grad;
mod deform_sample_grad_field;
mod device;
mod dropout;
mod field_scatter;
mod field_scatter_grad;
mod fill;
mod gather;
mod grad_norm;
mod layer_norm;
mod layer_norm_grad;
mod layout;
mod linear;
mod linear_weights;
mod pack;
mod pointwise;
mod rank;
mod reduce;
mod reference_view;
mod resize;
mod resize_grad;
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
mod winograd;
mod winograd_weights;

fn main() -> std::process::ExitCode {
    let kernels = [
        adamw::trials,
        attention::trials,
        attention_grad_kv::trials,
        attention_grad_q::trials,
        bounds::trials,
        blend::trials,
        conv2d::trials,
        conv2d_weights::trials,
        copy::trials,
        deform_sample::trials,
        deform_sample_grad::trials,
        deform_sample_grad_field::trials,
        dropout::trials,
        device::trials,
        field_scatter::trials,
        field_scatter_grad::trials,
        fill::trials,
        gather::trials,
        grad_norm::trials,
        layer_norm::trials,
        layer_norm_grad::trials,
        layout::trials,
        linear::trials,
        pack::trials,
        linear_weights::trials,
        pointwise::trials,
        rank::trials,
        reduce::trials,
        reference_view::trials,
        resize::trials,
        resize_grad::trials,
        scatter::trials,
        softmax::trials,
        splat::trials,
        split_heads::trials,
        split_heads_grad::trials,
        swiglu::trials,
        swiglu_grad::trials,
        token_expand::trials,
        token_expand_grad::trials,
        top_k::trials,
        traj_apply::trials,
        traj_apply_grad::trials,
        trajectory::trials,
        winograd::trials,
        winograd_weights::trials,
    ];
    omnix_tests::trials::run(kernels.iter().flat_map(|trials| trials()).collect())
}
