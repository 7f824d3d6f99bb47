// Activations by number; the host's `Activation` has the same order.
const ACT_NONE: u32 = 0u;
const ACT_RELU: u32 = 1u;
const ACT_GELU: u32 = 2u;
const ACT_SILU: u32 = 3u;

// erf to 4.5e-7 of its value: the odd rational minimax approximation of Eigen and XLA; beyond 4 erf is 1 in f32. One
// division and no exponential: an epilogue computes every activation on a software device, which executes all branches.
fn lib_erf(v: vec4<f32>) -> vec4<f32> {
    let x = clamp(v, vec4<f32>(-4.0), vec4<f32>(4.0));
    let z = x * x;
    let above = -1.60960333262415e-02 + z * (-2.95459980854025e-03 + z * (-7.34990630326855e-04
        + z * (-5.69250639462346e-05 + z * (-2.10102402082508e-06 + z * (2.77068142495902e-08
        - z * 2.72614225801306e-10)))));
    let below = -1.42647390514189e-02 + z * (-7.37332916720468e-03 + z * (-1.68282697438203e-03
        + z * (-2.13374055278905e-04 - z * 1.45660718464996e-05)));
    // At the bound itself a division that is not rounded correctly would leave GELU a tail that grows with its argument.
    return select(x * above / below, sign(v), abs(v) >= vec4<f32>(4.0));
}

fn lib_activate(x: vec4<f32>, act: u32) -> vec4<f32> {
    switch act {
        case ACT_RELU: { return max(x, vec4<f32>(0.0)); }
        case ACT_GELU: { return 0.5 * x * (1.0 + lib_erf(x * 0.7071067811865476)); }
        case ACT_SILU: { return x / (1.0 + exp(-x)); }
        default: { return x; }
    }
}
