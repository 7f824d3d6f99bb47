//! Every kernel over the shapes of the real networks: see the harness for the command line.

mod attention;
mod conv2d;
mod copy;
mod deform_sample;
mod field_scatter;
mod gather;
mod layer_norm;
mod linear;
mod pointwise;
mod reduce;
mod reference_view;
mod resize;
mod scatter;
mod softmax;
mod split_heads;
mod swiglu;
mod token_expand;
mod top_k;
mod traj_apply;
mod trajectory;
mod winograd;

use omnix_benches::{Bench, Options};
use omnix_kernels::KernelError;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    Bench::new(Options::from_args()?)?.run(&all)?;
    Ok(())
}

fn all(bench: &Bench) -> Result<(), KernelError> {
    linear::run(bench)?;
    attention::run(bench)?;
    layer_norm::run(bench)?;
    split_heads::run(bench)?;
    softmax::run(bench)?;
    reduce::run(bench)?;
    conv2d::run(bench)?;
    winograd::run(bench)?;
    resize::run(bench)?;
    copy::run(bench)?;
    pointwise::run(bench)?;
    swiglu::run(bench)?;
    gather::run(bench)?;
    scatter::run(bench)?;
    top_k::run(bench)?;
    reference_view::run(bench)?;
    token_expand::run(bench)?;
    field_scatter::run(bench)?;
    deform_sample::run(bench)?;
    traj_apply::run(bench)?;
    trajectory::run(bench)?;
    Ok(())
}
