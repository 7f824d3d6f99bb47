// Activations by number; the host's `Activation` has the same order.
const ACT_NONE: u32 = 0u;
const ACT_RELU: u32 = 1u;
const ACT_GELU: u32 = 2u;
const ACT_SILU: u32 = 3u;

// erf to 1.5e-7 absolute over all of f32 (Abramowitz and Stegun 7.1.26 is too coarse near 0 in
// relative terms, so small arguments take the Taylor series instead).
fn lib_erf(x: vec4<f32>) -> vec4<f32> {
    let a = abs(x);
    let x2 = x * x;
    let series = x * (1.1283791670955126 + x2 * (-0.37612638903183754 + x2 * (0.11283791670955126
        + x2 * (-0.026866170645131252 + x2 * (0.005223977625442188 + x2 * (-0.0008548327023450852
        + x2 * 0.00012055332981789664))))));
    let t = 1.0 / (1.0 + 0.3275911 * a);
    let tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    let far = sign(x) * (1.0 - tail * exp(-x2));
    return select(far, series, a < vec4<f32>(0.75));
}

fn lib_activate(x: vec4<f32>, act: u32) -> vec4<f32> {
    switch act {
        case ACT_RELU: { return max(x, vec4<f32>(0.0)); }
        case ACT_GELU: { return 0.5 * x * (1.0 + lib_erf(x * 0.7071067811865476)); }
        case ACT_SILU: { return x / (1.0 + exp(-x)); }
        default: { return x; }
    }
}
