// What a dispatch of `splat` sees: some points, and some rows of the picture (a band).

struct Params {
    // Points of this dispatch, and the index of the first among all.
    n: u32,
    first: u32,
    // Columns of the picture; the band's first row and its number of rows.
    width: u32,
    row: u32,
    rows: u32,
    // Distances of the first element from the start of the windows, in words.
    points_rest: u32,
    sizes_rest: u32,
    colours_rest: u32,
    y_rest: u32,
    // The largest radius of a splat, in pixels.
    largest: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// What DEPTH holds where no splat is: above every positive depth.
const LIB_EMPTY: u32 = 0xffffffffu;
