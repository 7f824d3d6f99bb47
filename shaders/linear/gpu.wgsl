// linear, GPUs: see lib/linear_params for the equation and the shapes, lib/tile_product and lib/tile_cooperative for the tiles
// and their roofline. n and k are multiples of 4.
#if HALF
enable f16;
#endif
#if T
#if !LANES
enable wgpu_cooperative_matrix;
#endif
#endif
#import linear_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> bias: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> gamma: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> residual: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> y: array<vec4<f32>>;

// First vec4 of a row.
alias Row = u32;

fn tile_rows() -> u32 {
    return p.m;
}

fn tile_depth() -> u32 {
    return p.k;
}

fn tile_row(row: u32) -> Row {
    return row * (p.k / 4u);
}

fn tile_x(row: Row, k: u32) -> vec4<f32> {
    if (k >= p.k) {
        return vec4<f32>(0.0);
    }
    return x[row + k / 4u];
}

fn finish(sum: vec4<f32>, row: u32, column: u32) {
    if (row >= p.m || column >= p.n) {
        return;
    }
    let at = row * (p.n / 4u) + column / 4u;
    var v = lib_scaled(sum, column);
    if ((p.flags & HAS_BIAS) != 0u) {
        v += bias[column / 4u];
    }
    v = lib_activate(v, p.act);
    if ((p.flags & HAS_GAMMA) != 0u) {
        v *= gamma[column / 4u];
    }
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += residual[at];
    }
    y[at] = v;
}

#if T
#import tile_cooperative
#else
#import tile_product
#endif
