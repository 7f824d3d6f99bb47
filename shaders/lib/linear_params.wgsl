// What all variants of `linear` share: parameters, bindings and the epilogue.
//
//   y[m, n] = residual[m, n] + gamma[n] * act(scale[n] * sum_k x[m, k] * w[k, n] + bias[n])
//
// x [m, k], w packed (lib/weights), bias [n], gamma [n], residual [m, n], y [m, n]; rows contiguous. scale [n] lies behind
// int8 weights and is 1 with all others.
#import activation
#import weights

const HAS_BIAS: u32 = 1u;
const HAS_GAMMA: u32 = 2u;
const HAS_RESIDUAL: u32 = 4u;
// Uniform windows: the sums go on from what y holds; y gets sums that are not finished.
const GO_ON: u32 = 8u;
const PARTIAL: u32 = 16u;

struct Params {
    m: u32,
    n: u32,
    k: u32,
    // First column of this dispatch; a multiple of 32.
    n0: u32,
    // Columns of 32 in this dispatch.
    blocks: u32,
    act: u32,
    flags: u32,
    // The packed depth of a column block, in k.
    k_packed: u32,
    // Row tiles that go by a column block before the next one (software variant).
    group: u32,
    // First k of this dispatch and how many: all but where weights come through uniform windows.
    k0: u32,
    k_len: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
#if W8
@group(0) @binding(7) var<storage, read> scale: array<vec4<f32>>;
#endif

// The finished sums of columns n .. n + 3 in the weights' own scale.
fn lib_scaled(sum: vec4<f32>, n: u32) -> vec4<f32> {
#if W8
    return sum * scale[n / 4u];
#else
    return sum;
#endif
}
