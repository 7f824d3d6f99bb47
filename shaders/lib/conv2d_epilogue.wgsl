// The end of a convolution on software devices, four channels of a pixel: bias, activation, residuals, y. Takes p, bias,
// residual, residual2 and y from the file that imports it.
#import activation
#import conv2d_flags
#import quad

// The bias of channels 4 n4 .. 4 n4 + 4, the same for all pixels.
fn lib_bias(n4: u32) -> vec4<f32> {
    if (n4 * 4u < p.co && (p.flags & HAS_BIAS) != 0u) {
        return lib_quad(bias[n4]);
    }
    return vec4<f32>(0.0);
}

// `at` counts quads of y; `added` is the bias.
fn lib_finish(sum: vec4<f32>, at: u32, added: vec4<f32>) {
    var v = lib_activate(sum + added, p.act);
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += lib_quad(residual[at]);
    }
    if ((p.flags & HAS_RESIDUAL2) != 0u) {
        v += lib_quad(residual2[at]);
    }
    y[at] = lib_to_quad(v);
}
