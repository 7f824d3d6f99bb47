// conv2d_weights, GPUs: see lib/conv2d_weights_params for the equation and the shapes, lib/tile_outer for the tile and its
// roofline. Rows of the product are the pixels of the output in order, those of a part together; a tap outside of the map adds a
// product with 0. ci and co are multiples of 4.
#import conv2d_weights_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> dy: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> out: array<vec4<f32>>;

// The tap of this workgroup.
var<private> ky: u32;
var<private> kx: u32;

fn outer_n() -> u32 {
    return p.co;
}

fn outer_k() -> u32 {
    return p.ci;
}

// Whether the tap of a pixel lies on the map, and where.
fn source(pixel: u32) -> vec3<i32> {
    let row = pixel / p.wo;
    let place = lib_frame(row);
    let iy = lib_source(place.y, ky);
    let ix = i32((pixel - row * p.wo) * p.stride + kx) - i32(p.pad);
    let inside = iy >= 0 && iy < i32(p.hi) && ix >= 0 && ix < i32(p.wi);
    if (!inside) {
        return vec3<i32>(0);
    }
    return vec3<i32>(1, i32(lib_x_row(place.x, iy)), ix);
}

// The gradient counts where the tap is on the map: elsewhere both are 0, and infinite gradients stay there.
fn outer_dy(pixel: u32, column: u32) -> vec4<f32> {
    if (source(pixel).x == 0) {
        return vec4<f32>(0.0);
    }
    return dy[(p.dy_rest + pixel * p.co + column) / 4u];
}

fn outer_x(pixel: u32, column: u32) -> vec4<f32> {
    let at = source(pixel);
    if (at.x == 0) {
        return vec4<f32>(0.0);
    }
    return x[(u32(at.y) + u32(at.z) * p.ci + column) / 4u];
}

fn outer_at(section: u32, n: u32, k: u32) -> u32 {
    return (p.out_rest + section * p.out_step + ((ky * p.kw + kx) * p.co + n) * p.ci + k) / 4u;
}

#import tile_outer

@compute @workgroup_size(128)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tiles = p.n_tiles * p.k_tiles;
    let at = lib_fold(group, groups);
    let section = at / (tiles * p.taps);
    let tap = at / tiles % p.taps;
    ky = tap / p.kw;
    kx = tap - ky * p.kw;
    let tile = at % tiles;
    let first = section * p.section;
    if (first >= p.rows) {
        return;
    }
    let end = min(first + p.section, p.rows);
    outer_tile(index, section, first * p.wo, end * p.wo, p.part * p.wo, tile / p.k_tiles * 64u, tile % p.k_tiles * 64u,
        (p.flags & GO_ON) != 0u);
}
