//! Every kernel over the shapes of the real networks: see the harness for the command line.

mod adamw;
mod attention;
mod attention_grad_kv;
mod attention_grad_q;
mod blend;
mod conv2d;
mod conv2d_weights;
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

use omnix_benches::{Bench, Options};
use omnix_kernels::KernelError;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    Bench::new(Options::from_args()?)?.run(&all)?;
    Ok(())
}

fn all(bench: &Bench) -> Result<(), KernelError> {
    linear::run(bench)?;
    pack::run(bench)?;
    linear_weights::run(bench)?;
    attention::run(bench)?;
    attention_grad_q::run(bench)?;
    attention_grad_kv::run(bench)?;
    layer_norm::run(bench)?;
    layer_norm_grad::run(bench)?;
    split_heads::run(bench)?;
    split_heads_grad::run(bench)?;
    softmax::run(bench)?;
    reduce::run(bench)?;
    grad_norm::run(bench)?;
    adamw::run(bench)?;
    blend::run(bench)?;
    conv2d::run(bench)?;
    conv2d_weights::run(bench)?;
    winograd::run(bench)?;
    winograd_weights::run(bench)?;
    resize::run(bench)?;
    resize_grad::run(bench)?;
    copy::run(bench)?;
    fill::run(bench)?;
    pointwise::run(bench)?;
    dropout::run(bench)?;
    swiglu::run(bench)?;
    swiglu_grad::run(bench)?;
    gather::run(bench)?;
    scatter::run(bench)?;
    top_k::run(bench)?;
    rank::run(bench)?;
    reference_view::run(bench)?;
    token_expand::run(bench)?;
    token_expand_grad::run(bench)?;
    field_scatter::run(bench)?;
    field_scatter_grad::run(bench)?;
    deform_sample::run(bench)?;
    deform_sample_grad::run(bench)?;
    deform_sample_grad_field::run(bench)?;
    traj_apply::run(bench)?;
    traj_apply_grad::run(bench)?;
    trajectory::run(bench)?;
    splat::run(bench)?;
    Ok(())
}
