// What all variants of `linear_weights` share: parameters and flags.
//
//   dw[n, k] = sum_m dy[m, n] * x[m, k]        db[n] = sum_m dy[m, n]
//
// x [m, k], dy [m, n], dw [n, k], db [n], all row-major. The rows are cut into sections, a section into parts of 64 rows: a part
// is summed row by row, the sums of parts are added in order, then those of sections. Both depend on the shape alone.

// Rows of a part.
const PART: u32 = 64u;
// The sums go on from what the output holds.
const GO_ON: u32 = 1u;

struct Params {
    // Rows of this dispatch, and of a section.
    m: u32,
    section: u32,
    // Columns of dy, and the first of this dispatch and one past its last.
    n: u32,
    n0: u32,
    n1: u32,
    // Columns of x.
    k: u32,
    // Tiles of this dispatch in n and in k.
    n_tiles: u32,
    k_tiles: u32,
    // Distance of the first number from the start of the output's window, and of two sections there (`add`: of the input's).
    out_rest: u32,
    out_step: u32,
    // `add`: numbers (or fours), sections, and the distance of the first number in the input's window.
    len: u32,
    count: u32,
    in_rest: u32,
    flags: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
