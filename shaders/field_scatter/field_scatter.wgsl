// field_scatter: the values of the chosen tokens on the grid, any WebGPU device:
//
//   field[s, t, cell, :] = z[t, s, i, :] where index[s, i] = cell, else rest
//
// z [T, S, K, c], index [S, K] ascending, rest [c], field [S, T, L, c]. An invocation owns a cell of one (s, t) and
// finds it in the index by bisection. A dispatch owns `sources` images and `times` times.
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
@group(0) @binding(1) var<storage, read> z: array<f32>;
@group(0) @binding(2) var<storage, read> index: array<u32>;
@group(0) @binding(3) var<storage, read> rest: array<f32>;
@group(0) @binding(4) var<storage, read_write> field: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = lib_fold(group, groups) * 64u + local.x;
    if (row >= p.sources * p.times * p.cells) {
        return;
    }
    let pair = row / p.cells;
    let cell = row - pair * p.cells;
    let s = pair / p.times;
    let t = pair - s * p.times;
    // The first of the image's indices that is not below the cell.
    let start = p.i_rest + s * p.k;
    var low = 0u;
    var high = p.k;
    for (var halving = 0u; halving < 32u; halving++) {
        if (low >= high) {
            break;
        }
        let middle = (low + high) / 2u;
        if (index[start + middle] < cell) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let at = min(low, p.k - 1u);
    let chosen = index[start + at] == cell;
    let source = p.z_rest + ((t * p.all_sources + s) * p.k + at) * p.c;
    let dest = p.f_rest + ((s * p.all_times + t) * p.cells + cell) * p.c;
    for (var i = 0u; i < p.c; i++) {
        if (chosen) {
            field[dest + i] = z[source + i];
        } else {
            field[dest + i] = rest[i];
        }
    }
}
