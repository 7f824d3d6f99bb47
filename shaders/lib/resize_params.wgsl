// What all variants of `resize` share: parameters and source coordinates.
//
//   y[f, oy, ox, c] = sum_{taps} wy wx x[f, iy, ix, c] + code[ox, c]                  for c < C / 2
//                                                      + code[wo + oy, c - C / 2]     for the others
//
// x [f, hi, wi, C], y [f, ho, wo, C], code [wo + ho, C / 2] (spec/da3.md 6.1), rows counted over the whole map. The
// source coordinate of output o is the rational (o a + b) / d (a, b, d an axis' own), split into cell and fraction in
// integers: no rounding error grows with o. The host passes b + d, so that the numerator is never negative.

struct Params {
    // Output pixels of this dispatch, in one frame of it, and columns.
    pixels: u32,
    frame_pixels: u32,
    wo: u32,
    hi: u32,
    wi: u32,
    // Channels, in the unit of the variant (numbers, twos, fours or eights).
    c: u32,
    y_a: u32,
    y_b: u32,
    y_d: u32,
    x_a: u32,
    x_b: u32,
    x_d: u32,
    // First output row of this dispatch, and first input row of its window of x.
    oy0: u32,
    iy0: u32,
    // Distance of the first pixel from the start of its window, in the unit of the variant.
    x_rest: u32,
    y_rest: u32,
    code_rest: u32,
    // Whether coordinates below 0 count as 0 (bilinear).
    clamp: u32,
    has_code: u32,
    // Lanes that share a pixel, a power of two up to 8 (software variants).
    lanes: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Cell and fraction of a source coordinate.
struct Coordinate {
    cell: i32,
    fraction: f32,
}

fn lib_coordinate(o: u32, a: u32, b: u32, d: u32) -> Coordinate {
    let n = o * a + b;
    let q = n / d;
    let cell = i32(q) - 1;
    if (p.clamp != 0u && cell < 0) {
        return Coordinate(0, 0.0);
    }
    return Coordinate(cell, f32(n - q * d) / f32(d));
}

// Keys' weights of the cells -1, 0, 1, 2 around a fraction.
fn lib_cubic(t: f32) -> vec4<f32> {
    let s = 1.0 - t;
    return vec4<f32>(
        -0.75 * t * s * s,
        (1.25 * t - 2.25) * t * t + 1.0,
        (1.25 * s - 2.25) * s * s + 1.0,
        -0.75 * s * t * t);
}
