// What the passes of `rank` share: parameters, and numbers as unsigned keys of the same order.
//
// The numbers of a row that are not NaN, in ascending order, have ranks from 0; the wanted one is found two bits of its key at a
// time from the top: `count` counts in each block of a row how many keys that begin as the wanted one go on with 00, 01, 10 and 11,
// `choose` adds the blocks and moves on. Before that, one pass counts what is not NaN, from which a quantile's rank follows. 17
// readings of x, integers only.

// Whether this pass counts the numbers that are not NaN.
const VALID: u32 = 1u;
// Whether this pass is the last.
const LAST: u32 = 2u;
// Whether the rank is a quantile's: round((N - 1) numerator / denominator), half to even, of N numbers.
const QUANTILE: u32 = 4u;

struct Params {
    // Rows of this dispatch, numbers of a row in it, numbers of a block, blocks in it.
    rows: u32,
    n: u32,
    block: u32,
    blocks: u32,
    // Bits below the two of this pass.
    shift: u32,
    flags: u32,
    // Of the quantile; else the rank in `numerator`.
    numerator: u32,
    denominator: u32,
    // Distances of the first word from the start of the windows.
    x_rest: u32,
    state_rest: u32,
    counts_rest: u32,
    y_rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

const NAN_KEY: u32 = 0xffffffffu;

// An unsigned number that orders as the float with these bits; NaN is above all, both zeros are equal.
fn key(bits: u32) -> u32 {
    let size = bits & 0x7fffffffu;
    if (size > 0x7f800000u) {
        return NAN_KEY;
    }
    if (size == 0u) {
        return 0x80000000u;
    }
    return select(bits | 0x80000000u, ~bits, bits != size);
}
