// What all variants of `layer_norm` share: parameters and flags.
//
//   y[m, c] = act((x[m, c] - mean_m) / sqrt(var_m + eps) * weight[c] + bias[c])
//
// mean and var over the c channels of a row, var with divisor c. The sum of squares is of differences from a mean, in
// a second pass or as it goes: a large common offset costs no precision.
#import activation

const HAS_WEIGHT: u32 = 1u;
const HAS_BIAS: u32 = 2u;

struct Params {
    m: u32,
    c: u32,
    act: u32,
    flags: u32,
    eps: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
