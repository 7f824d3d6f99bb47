// What all variants of `split_heads` share: parameters, flags and the place of an output element.
//
//   y[g, h, t, d] = scale * rope_t(norm(x[g * tokens + t, x_offset + h * D + 0..D]))[d]
//
// x [groups * tokens, x_stride]; y is head-major and padded with zeros: tokens to a multiple of 32, D to Dp,
// a multiple of 32. Rows: [groups][heads][tokens_pad][Dp]; key blocks: [groups][heads][tokens_pad / 32][Dp][32].
// norm is a layer norm over the D channels of a head (divisor D); rope is in lib/rope.
#import rope

const NORM: u32 = 1u;
const ROPE: u32 = 2u;
const KEY_BLOCKS: u32 = 4u;

struct Params {
    // Tokens of a group, and the same rounded up to 32.
    tokens: u32,
    tokens_pad: u32,
    heads: u32,
    head_dim: u32,
    // head_dim rounded up to 32.
    dp: u32,
    x_stride: u32,
    // Column of head 0, plus the numbers between the start of the binding of x and its first row.
    x_offset: u32,
    // Row of x at the start of the binding.
    x_row0: u32,
    // First (group, head), counted group * heads + head, and how many this dispatch covers.
    head0: u32,
    head_count: u32,
    // First token of this dispatch, how many, both multiples of 32, and the token at the start of y's binding.
    t0: u32,
    t_count: u32,
    y_t0: u32,
    rope_rows: u32,
    flags: u32,
    eps: f32,
    scale: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Distance of two channels of one token in y.
fn step_d() -> u32 {
    return select(1u, 32u, (p.flags & KEY_BLOCKS) != 0u);
}

// Index in y's binding of channel 0 of token t of the dispatch's i-th head.
fn place(i: u32, t: u32) -> u32 {
    let row = t - p.y_t0;
    let base = i * p.tokens_pad * p.dp;
    if ((p.flags & KEY_BLOCKS) != 0u) {
        return base + row / 32u * 32u * p.dp + row % 32u;
    }
    return base + row * p.dp;
}
