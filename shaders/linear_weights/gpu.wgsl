// linear_weights, GPUs: see lib/linear_weights_params for the equation and the shapes, lib/tile_outer for the tile and its
// roofline. n and k are multiples of 4.
#import linear_weights_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> dy: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> out: array<vec4<f32>>;

fn outer_n() -> u32 {
    return p.n1;
}

fn outer_k() -> u32 {
    return p.k;
}

fn outer_dy(row: u32, column: u32) -> vec4<f32> {
    return dy[(row * p.n + column) / 4u];
}

fn outer_x(row: u32, column: u32) -> vec4<f32> {
    return x[(row * p.k + column) / 4u];
}

fn outer_at(section: u32, n: u32, k: u32) -> u32 {
    return (p.out_rest + section * p.out_step + (n - p.n0) * p.k + k) / 4u;
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
    let section = at / tiles;
    let tile = at - section * tiles;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let end = min(first + p.section, p.m);
    outer_tile(index, section, first, end, PART, p.n0 + tile / p.k_tiles * 64u, tile % p.k_tiles * 64u, (p.flags & GO_ON) != 0u);
}
