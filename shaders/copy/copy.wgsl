// copy: y[dst0 + sum_d i_d * dst_d] = x[src0 + sum_d i_d * src_d] for all i in the shape.
//
// Dimensions come innermost first: dims[d] = (extent, source stride, destination stride, unused), d < rank.
// Everything is counted in the items of lib/item, which are moved as bits: NaN payloads and integers survive.
//
// Eight neighbouring invocations share a piece of one line (the innermost dimension), `steps` elements
// each, 8 apart: the integer divisions that find the line cost more than the copy on software devices.
#import grid
#import item

struct Params {
    dims: array<vec4<u32>, 6>,
    rank: u32,
    // Pieces a line, and elements an invocation in a piece.
    pieces: u32,
    steps: u32,
    // Pieces in all lines together.
    total: u32,
    src0: u32,
    dst0: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<Item>;
@group(0) @binding(2) var<storage, read_write> y: array<Item>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let piece = lib_fold(group, groups) * 8u + local.x / 8u;
    if (piece >= p.total) {
        return;
    }
    var rest = piece / p.pieces;
    let first = (piece - rest * p.pieces) * p.steps * 8u + local.x % 8u;
    var source = p.src0;
    var dest = p.dst0;
    for (var d = 1u; d < p.rank; d++) {
        let dim = p.dims[d];
        let next = rest / dim.x;
        let i = rest - next * dim.x;
        source += i * dim.y;
        dest += i * dim.z;
        rest = next;
    }
    let line = p.dims[0];
    for (var s = 0u; s < p.steps; s++) {
        let i = first + s * 8u;
        if (i < line.x) {
            y[dest + i * line.z] = x[source + i * line.y];
        }
    }
}
