// conv2d, software devices: see lib/conv2d_params for the equation and the shapes.
//
// Implicit matrix product: a workgroup is one subgroup of 8 lanes and owns $TM pixels x 32 channels of y;
// a lane owns 4 channels (one vec4). For 4 input channels at a time, lane j loads x of pixel j as one
// vec4 and the values reach the other lanes by constant shuffles; w comes from a uniform window, the only
// gather a software rasteriser does without branches. A window holds whole taps, or a part of one. No
// workgroup memory, no barrier. Needs ci and co to be multiples of 4.
// Sums run over k in order within a window, and windows depend on the weights' shape alone.
#import conv2d_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<uniform> w: array<Quad, 4096>;
@group(0) @binding(3) var<storage, read> bias: array<Quad>;
@group(0) @binding(4) var<storage, read> residual: array<Quad>;
@group(0) @binding(5) var<storage, read> residual2: array<Quad>;
@group(0) @binding(6) var<storage, read_write> y: array<Quad>;

fn finish(sum: vec4<f32>, pixel: u32, n4: u32) {
    if (pixel >= p.pixels || n4 * 4u >= p.co) {
        return;
    }
    let at = p.y_rest / 4u + pixel * (p.co / 4u) + n4;
    var v = sum;
    if ((p.flags & ACCUMULATE) != 0u) {
        v += lib_quad(y[at]);
    }
    if ((p.flags & LAST) != 0u) {
        if ((p.flags & HAS_BIAS) != 0u) {
            v += lib_quad(bias[n4]);
        }
        v = lib_activate(v, p.act);
        if ((p.flags & HAS_RESIDUAL) != 0u) {
            v += lib_quad(residual[at]);
        }
        if ((p.flags & HAS_RESIDUAL2) != 0u) {
            v += lib_quad(residual2[at]);
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
    let pixel = tile / p.blocks * ${TM}u;
    if (pixel >= p.pixels) {
        return;
    }
    let low = vec4<f32>(p.low);
#for r in 0..$R
    // Pixels past the end read the last one; they are not written.
    let at$r = lib_place(min(pixel + ${r*8}u + lane, p.pixels - 1u));
#end
#for i in 0..$TM
    var c$i = vec4<f32>(0.0);
#end
    let steps = p.c_len / 4u;
    // Several blocks share a window only where it holds all of k.
#if W16
    var wpos = block * p.k_packed * 4u + lane;
#else
    var wpos = block * p.k_packed * 8u + lane;
#endif
    for (var t = 0u; t < p.tap_len; t++) {
        let tap = p.tap0 + t;
        let ky = tap / p.kw;
        let kx = tap - ky * p.kw;
#for r in 0..$R
        let on$r = lib_on_map(at$r, ky, kx);
        // Taps outside read the window's start, and the value is replaced.
        var x$r = select(p.x_rest, lib_tap(at$r, ky, kx) + p.c0, on$r) / 4u;
#end
        for (var k = 0u; k < steps; k++) {
#for r in 0..$R
            let a$r = select(vec4<f32>(0.0), max(lib_quad(x[x$r]), low), on$r);
            x$r += 1u;
#end
#import product_step
        }
    }
    let n4 = p.n0 / 4u + block * 8u + lane;
#for i in 0..$TM
    finish(c$i, pixel + ${i}u, n4);
#end
}
