// What `gather` and `scatter` share: rows of 32-bit words, moved by eight neighbouring invocations
// together, `steps` elements each, 8 apart, so that one division finds the row of several elements.

struct Params {
    // Rows of this dispatch, and elements of a row (items, see lib/item).
    m: u32,
    c: u32,
    // Pieces a row, and elements an invocation in a piece.
    pieces: u32,
    steps: u32,
    // The bound window's rows of the indexed tensor: first, one past the last; rows of the whole tensor.
    lo: u32,
    hi: u32,
    n: u32,
    // Distances of the first element from the start of the windows.
    x_rest: u32,
    y_rest: u32,
    i_rest: u32,
    // Whether rows that lie in no window are written (gather: with zeros).
    fill: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
