// conv2d, software devices: see lib/conv2d_params for the equation and the shapes.
//
// Implicit matrix product: a workgroup is one subgroup of 8 lanes and owns $TM pixels x 32 channels of y;
// a lane owns 4 channels (one vec4). For 4 input channels at a time, lane j loads x of pixel j as one
// vec4 and the values reach the other lanes by exclusive-or shuffles: lane l sums pixels in the order i ^ l
// (lib/product_step). No workgroup memory, no barrier. Needs ci and co to be multiples of 4. Sums run over k in order.
#import conv2d_params
#import grid
#import tile_walk
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read> w: array<Quad>;
@group(0) @binding(3) var<storage, read> bias: array<Quad>;
@group(0) @binding(4) var<storage, read> residual: array<Quad>;
@group(0) @binding(5) var<storage, read> residual2: array<Quad>;
@group(0) @binding(6) var<storage, read_write> y: array<Quad>;

fn finish(sum: vec4<f32>, pixel: u32, n4: u32, added: vec4<f32>) {
    if (pixel >= p.pixels || n4 * 4u >= p.co) {
        return;
    }
    let at = p.y_rest / 4u + pixel * (p.co / 4u) + n4;
    var v = lib_activate(sum + added, p.act);
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += lib_quad(residual[at]);
    }
    if ((p.flags & HAS_RESIDUAL2) != 0u) {
        v += lib_quad(residual2[at]);
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
    let tile = lib_walk(lib_fold(group, groups), (p.pixels + ${TM-1}u) / ${TM}u, p.group, p.blocks);
    let pixel = tile.x * ${TM}u;
    let block = tile.y;
    if (pixel >= p.pixels || block >= p.blocks) {
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
    let steps = p.ci / 4u;
#import packed_start
    for (var tap = 0u; tap < p.taps; tap++) {
        let ky = tap / p.kw;
        let kx = tap - ky * p.kw;
#for r in 0..$R
        let on$r = lib_on_map(at$r, ky, kx);
        // Taps outside read the window's start, and the value is replaced.
        var x$r = select(p.x_rest, lib_tap(at$r, ky, kx), on$r) / 4u;
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
    var added = vec4<f32>(0.0);
    if (n4 * 4u < p.co && (p.flags & HAS_BIAS) != 0u) {
        added = lib_quad(bias[n4]);
    }
    // A loop whose end the driver's compiler cannot see: unrolled, this code is larger than a first cache and runs once.
    var sums: array<vec4<f32>, $TM>;
#for i in 0..$TM
    sums[$i] = c$i;
#end
    let end = min(p.pixels - pixel + 7u, ${TM}u) / 8u * 8u;
    for (var i = 0u; i < end; i++) {
        finish(sums[i], pixel + (i ^ lane), n4, added);
    }
}
