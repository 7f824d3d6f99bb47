// linear, software devices: see lib/linear_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM rows x 32 columns; a lane owns 4 columns (one
// vec4). For 4 k at a time, lane j loads x of row j as one vec4, and the values reach the other lanes
// by constant shuffles; w comes from a uniform window, the only gather a software rasteriser does
// without branches. No workgroup memory, no barrier. Needs k and n to be multiples of 4.
// Sums run over k in order, so neither the rows nor the windows chosen change a bit.
#import linear_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<uniform> w: array<Quad, 4096>;
@group(0) @binding(3) var<storage, read> bias: array<Quad>;
@group(0) @binding(4) var<storage, read> gamma: array<Quad>;
@group(0) @binding(5) var<storage, read> residual: array<Quad>;
@group(0) @binding(6) var<storage, read_write> y: array<Quad>;

fn finish(sum: vec4<f32>, row: u32, n4: u32) {
    if (row >= p.m || n4 * 4u >= p.n) {
        return;
    }
    let at = row * (p.n / 4u) + n4;
    var v = sum;
    if ((p.flags & ACCUMULATE) != 0u) {
        v += lib_quad(y[at]);
    }
    if ((p.flags & LAST) != 0u) {
        v = lib_scaled(v, n4 * 4u);
        if ((p.flags & HAS_BIAS) != 0u) {
            v += lib_quad(bias[n4]);
        }
        v = lib_activate(v, p.act);
        if ((p.flags & HAS_GAMMA) != 0u) {
            v *= lib_quad(gamma[n4]);
        }
        if ((p.flags & HAS_RESIDUAL) != 0u) {
            v += lib_quad(residual[at]);
        }
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
    let tile = lib_fold(group, groups);
    let block = tile % p.blocks;
    let row0 = tile / p.blocks * ${TM}u;
    if (row0 >= p.m) {
        return;
    }
    let k4 = p.k / 4u;
    let k_end = p.k_len / 4u;
#for r in 0..$R
    // Rows past the end read the last row; they are not written.
    var x$r = min(row0 + ${r*8}u + lane, p.m - 1u) * k4 + p.k0 / 4u;
#end
#for i in 0..$TM
    var c$i = vec4<f32>(0.0);
#end
#if W16
    var wpos = block * p.k_len / 2u * 8u + lane;
#else
#if W8
    // Several blocks share a window only where it holds all of k.
    var wpos = block * p.k_packed * 2u + lane;
#else
    var wpos = block * p.k_len * 8u + lane;
#endif
#endif
    for (var k = 0u; k < k_end; k++) {
#for r in 0..$R
        let a$r = lib_quad(x[x$r]);
        x$r += 1u;
#end
#import product_step
    }
    let n4 = p.n0 / 4u + block * 8u + lane;
#for i in 0..$TM
    finish(c$i, row0 + ${i}u, n4);
#end
}
