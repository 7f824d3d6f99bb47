//! Every kernel, every variant the device can run, against its oracle over many shapes: a trial for each test and family of
//! variants (`omnix_tests::trials`).

mod attention;
mod bounds;
mod conv2d;
mod copy;
mod deform_sample;
mod device;
mod field_scatter;
mod gather;
mod layer_norm;
mod layout;
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

fn main() -> std::process::ExitCode {
    let kernels = [
        attention::trials,
        bounds::trials,
        conv2d::trials,
        copy::trials,
        deform_sample::trials,
        device::trials,
        field_scatter::trials,
        gather::trials,
        layer_norm::trials,
        layout::trials,
        linear::trials,
        pointwise::trials,
        reduce::trials,
        reference_view::trials,
        resize::trials,
        scatter::trials,
        softmax::trials,
        split_heads::trials,
        swiglu::trials,
        token_expand::trials,
        top_k::trials,
        traj_apply::trials,
        trajectory::trials,
        winograd::trials,
    ];
    omnix_tests::trials::run(kernels.iter().flat_map(|trials| trials()).collect())
}
