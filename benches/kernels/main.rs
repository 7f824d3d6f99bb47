//! Every kernel over the shapes of the real networks: see the harness for the command line.

mod attention;
mod layer_norm;
mod linear;
mod reduce;
mod softmax;
mod split_heads;

use omnix_benches::{Bench, Options};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bench = Bench::new(Options::from_args()?)?;
    linear::run(&bench)?;
    attention::run(&bench)?;
    layer_norm::run(&bench)?;
    split_heads::run(&bench)?;
    softmax::run(&bench)?;
    reduce::run(&bench)?;
    Ok(())
}
