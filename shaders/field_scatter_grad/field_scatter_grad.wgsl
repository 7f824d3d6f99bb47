// field_scatter_grad: the gradient of the field at the cells of the chosen tokens, any WebGPU device:
//
//   dz[t, s, i, :] = dfield[s, t, index[s, i], :]
//
// dfield [S, T, L, c], index [S, K], dz [T, S, K, c]; an index out of range gives 0. What the other cells hold is a constant, which
// has no gradient. An invocation owns a number of dz. A dispatch owns `sources` images and `times` times.
#import grid

struct Params {
    // Source images and target times of this dispatch, and in all.
    sources: u32,
    times: u32,
    all_sources: u32,
    all_times: u32,
    k: u32,
    cells: u32,
    c: u32,
    // Distances of the first word from the start of the windows.
    z_rest: u32,
    i_rest: u32,
    f_rest: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> dfield: array<f32>;
@group(0) @binding(2) var<storage, read> index: array<u32>;
@group(0) @binding(3) var<storage, read_write> dz: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = lib_fold(group, groups) * 64u + local.x;
    let row = p.k * p.c;
    if (number >= p.sources * p.times * row) {
        return;
    }
    let pair = number / row;
    let inside = number - pair * row;
    let t = pair / p.sources;
    let s = pair - t * p.sources;
    let token = inside / p.c;
    let channel = inside - token * p.c;
    let cell = index[p.i_rest + s * p.k + token];
    let source = p.f_rest + ((s * p.all_times + t) * p.cells + min(cell, p.cells - 1u)) * p.c + channel;
    dz[p.z_rest + (t * p.all_sources + s) * row + inside] = select(0.0, dfield[source], cell < p.cells);
}
