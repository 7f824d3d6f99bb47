// linear, software devices: see lib/linear_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM rows x 32 columns; a lane owns 4 columns (one
// vec4). For 4 k at a time, lane j loads x of row j as one vec4, and the values reach the other lanes
// by exclusive-or shuffles: lane l sums rows in the order i ^ l (lib/product_step). No workgroup memory, no barrier.
// Needs k and n to be multiples of 4. Sums run over k in order.
//
// WINDOWS takes w through 64 KiB uniform windows, a dispatch each: a load from one is 3 or 4 instructions a lane without
// a branch, for 18 from storage. With 16 vector registers and a smaller store of decoded instructions that makes up for the
// dispatches; with AVX-512 it does not (benches/log/2026-11-28-zen-3.md).
#import linear_params
#import grid
#import tile_walk
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
#if WINDOWS
@group(0) @binding(2) var<uniform> w: array<Quad, 4096>;
#else
@group(0) @binding(2) var<storage, read> w: array<Quad>;
#endif
@group(0) @binding(3) var<storage, read> bias: array<Quad>;
@group(0) @binding(4) var<storage, read> gamma: array<Quad>;
@group(0) @binding(5) var<storage, read> residual: array<Quad>;
@group(0) @binding(6) var<storage, read_write> y: array<Quad>;

// `added` is the bias, `scaled` the layer scale: the same for all rows of a tile.
fn finish(sum: vec4<f32>, row: u32, n4: u32, added: vec4<f32>, scaled: vec4<f32>) {
    if (row >= p.m || n4 * 4u >= p.n) {
        return;
    }
    let at = row * (p.n / 4u) + n4;
#if WINDOWS
    if ((p.flags & PARTIAL) != 0u) {
        y[at] = lib_to_quad(sum);
        return;
    }
#endif
    var v = lib_activate(lib_scaled(sum, n4 * 4u) + added, p.act) * scaled;
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += lib_quad(residual[at]);
    }
    y[at] = lib_to_quad(v);
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let tile = lib_walk(lib_fold(group, groups), (p.m + ${TM-1}u) / ${TM}u, p.group, p.blocks);
    let row0 = tile.x * ${TM}u;
    let block = tile.y;
    if (row0 >= p.m || block >= p.blocks) {
        return;
    }
    let k4 = p.k / 4u;
#for r in 0..$R
    // Rows past the end read the last row; they are not written.
    var x$r = min(row0 + ${r*8}u + lane, p.m - 1u) * k4 + p.k0 / 4u;
#end
#for i in 0..$TM
    var c$i = vec4<f32>(0.0);
#end
    let n4 = p.n0 / 4u + block * 8u + lane;
#if WINDOWS
    if ((p.flags & GO_ON) != 0u && n4 * 4u < p.n) {
#for i in 0..$TM
        if (row0 + (${i}u ^ lane) < p.m) {
            c$i = lib_quad(y[(row0 + (${i}u ^ lane)) * (p.n / 4u) + n4]);
        }
#end
    }
#endif
#import packed_start
    for (var k = 0u; k < p.k_len / 4u; k++) {
#for r in 0..$R
        let a$r = lib_quad(x[x$r]);
        x$r += 1u;
#end
#import product_step
    }
    var added = vec4<f32>(0.0);
    var scaled = vec4<f32>(1.0);
    if (n4 * 4u < p.n) {
        if ((p.flags & HAS_BIAS) != 0u) {
            added = lib_quad(bias[n4]);
        }
        if ((p.flags & HAS_GAMMA) != 0u) {
            scaled = lib_quad(gamma[n4]);
        }
    }
    // A loop whose end the driver's compiler cannot see: unrolled, this code is larger than a first cache and runs once.
    var sums: array<vec4<f32>, $TM>;
#for i in 0..$TM
    sums[$i] = c$i;
#end
    let end = min(p.m - row0 + 7u, ${TM}u) / 8u * 8u;
    for (var i = 0u; i < end; i++) {
        finish(sums[i], row0 + (i ^ lane), n4, added, scaled);
    }
}
