//! Gradients of graphs on the device, against central differences of the f64 interpreter (`omnix_tests::interpret`): every operation's
//! rule over many shapes, a file for each family of operations; and what the passes promise that record gradients and adopt parameters.

mod adopt;
mod attention;
mod case;
mod convolution;
mod feed_forward;
mod indices;
mod layer_norm;
mod linear;
mod motion;
mod moves;
mod network;
mod pass;
mod pointwise;
mod reduce;
mod resize;
mod sampling;

fn main() -> std::process::ExitCode {
    let families = [
        adopt::trials,
        attention::trials,
        convolution::trials,
        feed_forward::trials,
        indices::trials,
        layer_norm::trials,
        linear::trials,
        motion::trials,
        moves::trials,
        network::trials,
        pass::trials,
        pointwise::trials,
        reduce::trials,
        resize::trials,
        sampling::trials,
    ];
    omnix_tests::trials::run(families.iter().flat_map(|trials| trials()).collect())
}
