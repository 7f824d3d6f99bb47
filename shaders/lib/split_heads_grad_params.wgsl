// What all variants of `split_heads_grad` share: parameters, flags and indices.
//
// With n the normalised channels of a head (lib/split_heads_params has the forward pass) and dy the gradient of its result:
//
//   u = scale * turned back(dy)                     the rotation of lib/rope with the sines' sign changed
//   dx = u, or with a norm, g = u weight:  inverse (g - mean(g) - n mean(g n)),  inverse = 1 / sqrt(var + eps)
//   dweight[d] = sum u[d] n[d],  dbias[d] = sum u[d]   over all tokens and heads
//
// dy [groups][heads][tokens_pad][Dp], x [groups tokens, x_stride], dx [groups tokens, dx_stride]: of both, the columns of the heads.
// Heads leave mean and inverse in stats [groups tokens][heads][2], from which the columns take n. Columns are the channels of
// all heads side by side, summed over rows of tokens, which are cut into sections and parts as those of `linear_weights`; the
// sums of heads are added last.
#import rope

const NORM: u32 = 1u;
const ROPE: u32 = 2u;
// Columns: the sums go on from what the outputs hold.
const GO_ON: u32 = 4u;
// Rows of a part.
const PART: u32 = 64u;

struct Params {
    // Tokens of a group, and the same rounded up to 32.
    tokens: u32,
    tokens_pad: u32,
    heads: u32,
    head_dim: u32,
    // head_dim rounded up to 32.
    dp: u32,
    x_stride: u32,
    // Column of head 0, plus the numbers between the start of the binding and its first row.
    x_offset: u32,
    dx_stride: u32,
    dx_offset: u32,
    // Row of tokens at the start of the bindings of x, dx and stats; numbers of stats before it.
    row0: u32,
    stats_rest: u32,
    // Row of dy, counted over groups and heads with their padding, at the start of its binding.
    dy_row0: u32,
    // Heads: first (group, head), counted group * heads + head, and how many; first token and how many. Columns: first head and how many.
    head0: u32,
    head_count: u32,
    t0: u32,
    t_count: u32,
    rope_rows: u32,
    flags: u32,
    eps: f32,
    scale: f32,
    // Columns: first row of this dispatch and how many, rows of a section, numbers of one section's sums; distances of the first sum.
    first: u32,
    m: u32,
    section: u32,
    step: u32,
    weight_rest: u32,
    bias_rest: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
