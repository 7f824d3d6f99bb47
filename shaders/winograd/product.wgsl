// winograd, second pass: M[q] = V[q] U[q] for the 36 places q; see lib/winograd_params.
//
// The tile of linear's software variant: a workgroup is one subgroup of 8 lanes and owns $TM rows x 32 columns of one place.
// U is packed (lib/weights) with k = q ci + c. Sums run over the channels in order.
#import winograd_params
#import weights
#import grid
#import tile_walk

@group(0) @binding(1) var<storage, read> w: array<Quad>;
// Bound for writing as m is: one buffer cannot be bound both ways in one dispatch.
@group(0) @binding(2) var<storage, read_write> v: array<Quad>;
@group(0) @binding(3) var<storage, read_write> m: array<Quad>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let index = lib_fold(group, groups);
    let row_tiles = (p.tiles + ${TM-1}u) / ${TM}u;
    let q = index / (row_tiles * p.blocks);
    if (q >= 36u) {
        return;
    }
    let tile = lib_walk(index - q * row_tiles * p.blocks, row_tiles, p.group, p.blocks);
    let row0 = tile.x * ${TM}u;
    let steps = p.ci / 4u;
#for r in 0..$R
    // Rows past the end read the last row; they are not written.
    var x$r = (q * p.stride + min(row0 + ${r*8}u + lane, p.tiles - 1u)) * steps;
#end
#for i in 0..$TM
    var c$i = vec4<f32>(0.0);
#end
    var wpos = (tile.y * 36u + q) * p.ci * 8u + lane;
    for (var k = 0u; k < steps; k++) {
#for r in 0..$R
        let a$r = lib_quad(v[x$r]);
        x$r += 1u;
#end
#import product_step
    }
    let width = p.co / 4u;
    // A zero that the driver's compiler cannot see. Packed as they are, the sums would live in the halves of 512-bit registers, and
    // all of them be spilled and loaded as 512 bits in every turn of the loop (benches/log/2026-11-29-zen-4.md).
    let zero = vec4<f32>(f32(p.ci >> 31u));
    let n4 = tile.y * 8u + lane;
    let to = (q * p.stride + row0) * width + n4;
    if (n4 < width) {
#for i in 0..$TM
        if (row0 + (${i}u ^ lane) < p.tiles) {
            m[to + (${i}u ^ lane) * width] = lib_to_quad(c$i + zero);
        }
#end
    }
}
