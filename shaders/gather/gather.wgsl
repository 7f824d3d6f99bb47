// gather: y[r, :] = x[index[r], :], x [n, c], index [m], y [m, c]; rows whose index is n or more are zero.
//
// Words are moved as bits. A dispatch sees the rows lo..hi of x and leaves alone what others gather.
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
    let here = at >= p.lo && at < p.hi;
    if (!here && (p.fill == 0u || at < p.n)) {
        return;
    }
    let first = (piece - row * p.pieces) * p.steps * 8u + local.x % 8u;
    let source = p.x_rest + select(0u, at - p.lo, here) * p.c;
    let dest = p.y_rest + row * p.c;
    for (var s = 0u; s < p.steps; s++) {
        let i = first + s * 8u;
        if (i < p.c) {
            y[dest + i] = select(Item(), x[source + i], here);
        }
    }
}
