//! Every kernel over the shapes of the real networks: see the harness for the command line.

mod attention;
mod conv2d;
mod copy;
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
mod top_k;

use omnix_benches::{Bench, Options};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bench = Bench::new(Options::from_args()?)?;
    linear::run(&bench)?;
    attention::run(&bench)?;
    layer_norm::run(&bench)?;
    split_heads::run(&bench)?;
    softmax::run(&bench)?;
    reduce::run(&bench)?;
    conv2d::run(&bench)?;
    resize::run(&bench)?;
    copy::run(&bench)?;
    pointwise::run(&bench)?;
    swiglu::run(&bench)?;
    gather::run(&bench)?;
    scatter::run(&bench)?;
    top_k::run(&bench)?;
    reference_view::run(&bench)?;
    Ok(())
}
