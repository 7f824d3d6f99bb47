// What all variants of `conv2d` share: parameters, the place of a pixel, and which taps exist.
//
//   y[f, oy, ox, o] = act(sum_{ky, kx, c} pre(x[f, oy s + ky - pad, ox s + kx - pad, c]) w[ky, kx, c, o] + bias[o])
//                     + residual[f, oy, ox, o] + residual2[f, oy, ox, o]
//
// pre is the identity or ReLU; x outside of the map is 0. x [f, hi, wi, ci], y and the residuals
// [f, ho, wo, co], channels last; w packed (lib/weights) with k = (ky kw + kx) ci + c.
//
// A dispatch owns whole frames, or a band of output rows of one frame; `pixels` counts its output pixels.
#import activation
#import conv2d_flags
#import weights

struct Params {
    pixels: u32,
    // Output columns, and output pixels of this dispatch in one frame.
    wo: u32,
    frame_pixels: u32,
    hi: u32,
    wi: u32,
    ci: u32,
    co: u32,
    kw: u32,
    taps: u32,
    stride: u32,
    pad: u32,
    // First output row of this dispatch, and first input row of its window of x.
    oy0: u32,
    iy0: u32,
    // Distance in words of the first pixel from the start of its window.
    x_rest: u32,
    y_rest: u32,
    // First channel of y, number of 32-channel blocks, packed depth of a block.
    n0: u32,
    blocks: u32,
    k_packed: u32,
    act: u32,
    flags: u32,
    // Least value of pre(x): 0 for ReLU, else minus infinity.
    low: f32,
    // Pixel tiles that go by a column block before the next one (software variant).
    group: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Where a pixel's taps begin: the row (over all frames of the window) and the column of tap (0, 0), which
// may lie outside, and the row within the frame.
struct Place {
    row: i32,
    y: i32,
    x: i32,
}

fn lib_place(pixel: u32) -> Place {
    let frame = pixel / p.frame_pixels;
    let inside = pixel - frame * p.frame_pixels;
    let row = inside / p.wo;
    let y = i32((row + p.oy0) * p.stride) - i32(p.pad);
    return Place(i32(frame * p.hi) + y - i32(p.iy0), y, i32((inside - row * p.wo) * p.stride) - i32(p.pad));
}

// Whether tap (ky, kx) of the pixel lies on the map.
fn lib_on_map(at: Place, ky: u32, kx: u32) -> bool {
    let y = at.y + i32(ky);
    let x = at.x + i32(kx);
    return y >= 0 && y < i32(p.hi) && x >= 0 && x < i32(p.wi);
}

// First word of tap (ky, kx) in the window of x; only for taps on the map.
fn lib_tap(at: Place, ky: u32, kx: u32) -> u32 {
    return p.x_rest + u32((at.row + i32(ky)) * i32(p.wi) + at.x + i32(kx)) * p.ci;
}
