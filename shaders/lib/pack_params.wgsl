// What all variants of `pack` share: parameters.

struct Params {
    // Columns and depth of the matrix.
    n: u32,
    k: u32,
    // Blocks of y from `first_block` on.
    blocks: u32,
    first_block: u32,
    // Rows of 32 words in a block, and how many invocations share a column of them.
    rows: u32,
    base: u32,
    n_lo: u32,
    n_hi: u32,
    n_step: u32,
    k_lo: u32,
    k_hi: u32,
    k_step: u32,
    chunks: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
