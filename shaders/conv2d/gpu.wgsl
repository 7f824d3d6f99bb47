// conv2d, GPUs: see lib/conv2d_params for the equation and the shapes.
//
// Implicit matrix product: rows are pixels, k the taps' channels, gathered while they are staged; the tiles and their
// roofline are in lib/tile_product and lib/tile_cooperative. A 3x3 kernel reads a pixel nine times, from L1 or L2: 18
// instead of 2 flop a byte from memory for each output channel. ci and co are multiples of 4.
#if HALF
enable f16;
#endif
#if T
#if !LANES
enable wgpu_cooperative_matrix;
#endif
#endif
#import conv2d_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> bias: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> residual: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> residual2: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> y: array<vec4<f32>>;

alias Row = Place;

fn tile_rows() -> u32 {
    return p.pixels;
}

fn tile_depth() -> u32 {
    return p.taps * p.ci;
}

fn tile_row(pixel: u32) -> Row {
    return lib_place(pixel);
}

// Four channels lie within one tap.
fn tile_x(place: Row, k: u32) -> vec4<f32> {
    let tap = k / p.ci;
    let ky = tap / p.kw;
    let kx = tap - ky * p.kw;
    if (tap < p.taps && lib_on_map(place, ky, kx)) {
        return max(x[(lib_tap(place, ky, kx) + k - tap * p.ci) / 4u], vec4<f32>(p.low));
    }
    return vec4<f32>(0.0);
}

fn finish(sum: vec4<f32>, pixel: u32, column: u32) {
    if (pixel >= p.pixels || column >= p.co) {
        return;
    }
    let at = (p.y_rest + pixel * p.co + column) / 4u;
    var v = sum;
    if ((p.flags & HAS_BIAS) != 0u) {
        v += bias[column / 4u];
    }
    v = lib_activate(v, p.act);
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += residual[at];
    }
    if ((p.flags & HAS_RESIDUAL2) != 0u) {
        v += residual2[at];
    }
    y[at] = v;
}

#if T
#import tile_cooperative
#else
#import tile_product
#endif
