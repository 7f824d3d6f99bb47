// What all variants of `conv2d_weights` share: parameters and flags.
//
//   out[section, ky, kx, o, c] = sum_{f, oy, ox} dy[f, oy, ox, o] x[f, oy s + ky - pad, ox s + kx - pad, c]
//
// x outside of the map is 0. x [f, hi, wi, ci], dy [f, ho, wo, co], channels last. The output rows of all frames, counted together,
// are cut into sections, a section into parts of `part` rows: a part is summed pixel by pixel, the sums of parts are added
// in order, then (turn.wgsl) those of sections. Both depend on the shape alone.

// The sums go on from what the output holds.
const GO_ON: u32 = 1u;

struct Params {
    // Output rows of this dispatch, of a section and of a part; columns; rows of a frame.
    rows: u32,
    section: u32,
    part: u32,
    wo: u32,
    ho: u32,
    hi: u32,
    wi: u32,
    ci: u32,
    co: u32,
    kw: u32,
    taps: u32,
    stride: u32,
    pad: u32,
    // First output row of this dispatch within its frame, and the row of x, counted from the same frame's first, at the start of
    // the window.
    oy0: u32,
    iy0: u32,
    // Distance in words of the first number from the start of its window.
    x_rest: u32,
    dy_rest: u32,
    out_rest: u32,
    // Words of a section's sums.
    out_step: u32,
    // Tiles of output channels and of input channels.
    n_tiles: u32,
    k_tiles: u32,
    // `turn`: sections of this dispatch, and numbers.
    count: u32,
    len: u32,
    flags: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    pad3: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Frame (from that of the dispatch's first row on) and row within it of an output row of the dispatch.
fn lib_frame(row: u32) -> vec2<u32> {
    let r = row + p.oy0;
    let frame = r / p.ho;
    return vec2<u32>(frame, r - frame * p.ho);
}

// Row of the map that tap row ky of an output row reads; it may lie outside.
fn lib_source(oy: u32, ky: u32) -> i32 {
    return i32(oy * p.stride + ky) - i32(p.pad);
}

// First word, in the window of x, of a row of the map in a frame.
fn lib_x_row(frame: u32, iy: i32) -> u32 {
    return p.x_rest + (frame * p.hi + u32(iy) - p.iy0) * p.wi * p.ci;
}

// First output column whose tap column kx lies on the map, and one past the last.
fn lib_columns(kx: u32) -> vec2<u32> {
    var first = 0u;
    if (p.pad > kx) {
        first = (p.pad - kx + p.stride - 1u) / p.stride;
    }
    var end = 0u;
    if (p.wi + p.pad > kx) {
        end = min((p.wi + p.pad - kx - 1u) / p.stride + 1u, p.wo);
    }
    return vec2<u32>(first, end);
}
