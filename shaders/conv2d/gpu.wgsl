// conv2d, GPUs: see lib/conv2d_params for the equation and the shapes.
//
// Implicit matrix product: a workgroup of 16x16 owns 64 pixels x 64 channels (two column blocks); 16 k at a
// time are staged in workgroup memory (8 KiB), x gathered and transposed so that an invocation reads its 4
// pixels as one vec4. An invocation owns 4x4. Any number of channels. Sums run over k in order.
#import conv2d_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> residual: array<f32>;
@group(0) @binding(5) var<storage, read> residual2: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

const STEP: u32 = 16u;
// [k][pixel of 4]: 16 x 16 vec4.
var<workgroup> xs: array<vec4<f32>, 256>;
// [k][channel of 4].
var<workgroup> ws: array<vec4<f32>, 256>;

fn weight(block: u32, k: u32, lane: u32) -> vec4<f32> {
    if (k >= p.taps * p.ci || block >= p.blocks) {
        return vec4<f32>(0.0);
    }
    return lib_weight(block, k, lane);
}

fn at(place: Place, tap: u32, c: u32) -> f32 {
    let ky = tap / p.kw;
    let kx = tap - ky * p.kw;
    if (tap < p.taps && lib_on_map(place, ky, kx)) {
        return max(x[lib_tap(place, ky, kx) + c], p.low);
    }
    return 0.0;
}

fn finish(sum: vec4<f32>, pixel: u32, column: u32) {
    if (pixel >= p.pixels) {
        return;
    }
    var v = sum;
    if ((p.flags & HAS_BIAS) != 0u) {
        for (var i = 0u; i < 4u; i++) {
            if (column + i < p.co) {
                v[i] += bias[column + i];
            }
        }
    }
    v = lib_activate(v, p.act);
    for (var i = 0u; i < 4u; i++) {
        if (column + i < p.co) {
            let at = p.y_rest + pixel * p.co + column + i;
            var out = v[i];
            if ((p.flags & HAS_RESIDUAL) != 0u) {
                out += residual[at];
            }
            if ((p.flags & HAS_RESIDUAL2) != 0u) {
                out += residual2[at];
            }
            y[at] = out;
        }
    }
}

@compute @workgroup_size(16, 16)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let wide = (p.blocks + 1u) / 2u;
    let column0 = tile % wide * 64u;
    let pixel0 = tile / wide * 64u;
    // Which part of the tiles this invocation stages: x by (k, pixel of 4), w by (k, channel of 4).
    let stage_k = index % STEP;
    let stage_4 = index / STEP;
    let w_column = column0 + index % STEP * 4u;
#for i in 0..4
    var c$i = vec4<f32>(0.0);
    // Pixels past the end read the last one; they are not written.
    let at$i = lib_place(min(pixel0 + stage_4 * 4u + ${i}u, p.pixels - 1u));
#end
    let depth = p.taps * p.ci;
    for (var k0 = 0u; k0 < depth; k0 += STEP) {
        let tap = (k0 + stage_k) / p.ci;
        let c = k0 + stage_k - tap * p.ci;
        xs[stage_k * STEP + stage_4] = vec4<f32>(at(at0, tap, c), at(at1, tap, c), at(at2, tap, c), at(at3, tap, c));
        ws[index] = weight(w_column / 32u, k0 + stage_4, w_column % 32u / 4u);
        workgroupBarrier();
        for (var k = 0u; k < STEP; k++) {
            let a = xs[k * STEP + local.y];
            let b = ws[k * STEP + local.x];
#for i in 0..4
            c$i = fma(vec4<f32>(a[$i]), b, c$i);
#end
        }
        workgroupBarrier();
    }
#for i in 0..4
    finish(c$i, pixel0 + local.y * 4u + ${i}u, p.n0 + column0 + local.x * 4u);
#end
}
