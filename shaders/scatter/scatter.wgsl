// scatter: y[index[r], :] = x[r, :], x [m, c], index [m], y [n, c]; rows of y no index names keep their
// value, indices of n or more are skipped. No two rows of x may have the same index.
//
// Words are moved as bits. A dispatch sees the rows lo..hi of y and skips what others write.
#import rows
#import grid
#import item

@group(0) @binding(1) var<storage, read> x: array<Item>;
@group(0) @binding(2) var<storage, read> index: array<u32>;
@group(0) @binding(3) var<storage, read_write> y: array<Item>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let piece = lib_fold(group, groups) * 8u + local.x / 8u;
    let row = piece / p.pieces;
    if (row >= p.m) {
        return;
    }
    let at = index[p.i_rest + row];
    if (at < p.lo || at >= p.hi) {
        return;
    }
    let first = (piece - row * p.pieces) * p.steps * 8u + local.x % 8u;
    let source = p.x_rest + row * p.c;
    let dest = p.y_rest + (at - p.lo) * p.c;
    for (var s = 0u; s < p.steps; s++) {
        let i = first + s * 8u;
        if (i < p.c) {
            y[dest + i] = x[source + i];
        }
    }
}
