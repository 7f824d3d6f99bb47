// What the three passes of `winograd` share: the equation, the parameters, the place of a tile.
//
//   y = act(conv(pre(x)) + bias) + residual + residual2, a kernel of 3x3, stride 1, as in lib/conv2d_params
//
// by F(4x4, 3x3) (Lavin and Gray 2016, section 4.2): a tile is 4x4 pixels of y, which see 6x6 pixels d of x. With
//   V = Bt d B,  M[q] = sum_c V[q, c] U[q, c, o] for each of the 36 places q,  y = At M A,  U = G w Gt (made before),
// that is 36 multiplications a tile, input and output channel, where the sum over taps has 144. The polynomials behind it are
// evaluated at 0, 3/4, -3/4, 3/2, -3/2 and infinity, not at the paper's 0, 1, -1, 2, -2: a quarter of the rounding error.
//
// x [f, hi, wi, ci], y and the residuals [f, ho, wo, co], channels last. A dispatch owns a band of consecutive tiles, in the
// order (frame, row, column). v [36, stride, ci] and m [36, stride, co] go by place and tile of the band.
#import quad

struct Params {
    // Tiles of the band, its first tile, and rows of v and m a place.
    tiles: u32,
    tile0: u32,
    stride: u32,
    // Tiles in a row and in a column of a map.
    across: u32,
    down: u32,
    hi: u32,
    wi: u32,
    ho: u32,
    wo: u32,
    ci: u32,
    co: u32,
    pad: u32,
    // Distance in words of the first pixel from the start of its window.
    x_rest: u32,
    y_rest: u32,
    // Number of 32-channel blocks of U, and tiles of 32 rows that go by one before the next.
    blocks: u32,
    group: u32,
    flags: u32,
    // Least value of pre(x) and of act(): 0 for ReLU, else minus infinity.
    low: f32,
    floor: f32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Frame of a tile, and the row and column of its first pixel of y.
fn lib_tile(tile: u32) -> vec3<u32> {
    let row = tile / p.across;
    let frame = row / p.down;
    return vec3<u32>(frame, (row - frame * p.down) * 4u, (tile - row * p.across) * 4u);
}
