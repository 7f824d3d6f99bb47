// trajectory, second step on GPUs: see trajectory.wgsl for the equation, pack.wgsl for what the field looks like here.
//
// An invocation owns a pixel and $TW times: the cells and weights of a point are found once for all of them, and the nine
// channels of a cell are three vec4. Same sums in the same order as the other variants.
//
// Roofline, a pixel and time with the release's 4 levels of 9 points: 36 points * 4 cells * 9 channels = 2592 operations for
// 36 bytes of result in memory; the field (26 KB a level and time on a 36 x 20 grid) comes from L1, 14 neighbouring
// pixels a row from the same cell. So load instructions bound, 3 per cell instead of 9, and positions, about 40 operations a
// point, are shared by $TW times: 432 loads and 4000 operations a time instead of 1368 and 5000. About ${TW*12+32}
// registers: 768 invocations a 64 K-register unit.
// Workgroup memory would hold a level and time only as f16 (26 KB are more than WebGPU's 16 KiB), read by the same
// unit that is L1; f16 would round offsets of points to 5e-4 of themselves to save a third of the loads (8 numbers in
// 16 bytes, of 9): motion is what this kernel is for, so neither is offered. Subgroup shuffles: neighbours share cells, but
// which cells is known only at run time. Products of matrices: weights are sparse, 4 cells of 720 per point.
#import deform_params
#import motion
#import grid

@group(0) @binding(1) var<storage, read> offsets: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> packed: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> anchor: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> y: array<f32>;
@group(0) @binding(6) var<storage, read_write> theta: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Neighbouring invocations are neighbouring pixels.
    let all = lib_fold(group, groups) * 64u + index;
    let first_time = all / p.n * ${TW}u;
    let i = all % p.n;
    if (first_time >= p.nt) {
        return;
    }
    let pixel_at = p.x_rest + i * 3u;
    let first = anchor[pixel_at];
    let second = anchor[pixel_at + 1u];
    let third = anchor[pixel_at + 2u];
    let reference = vec2<f32>(second.w, third.w);
#for t in 0..$TW
    // Times past the end repeat the last and are not written.
    let slot$t = (p.skip + min(first_time + ${t}u, p.nt - 1u)) * p.slot;
    var a$t = vec4<f32>(0.0);
    var b$t = vec4<f32>(0.0);
    var c$t = 0.0;
#end
    var o = p.o_rest / 2u + i * p.levels * p.points;
    var w = p.w_rest + i * p.levels * p.points;
    for (var l = 0u; l < p.levels; l++) {
        for (var j = 0u; j < p.points; j++) {
            let taps = lib_taps(reference, offsets[o], weights[w]);
            o += 1u;
            w += 1u;
#for c in 0..4
            {
                let at = l * p.level + taps.cell[$c] * 3u;
                let weight = taps.weight[$c];
#for t in 0..$TW
                a$t = fma(vec4<f32>(weight), packed[at + slot$t], a$t);
                b$t = fma(vec4<f32>(weight), packed[at + slot$t + 1u], b$t);
                c$t = fma(weight, packed[at + slot$t + 2u].x, c$t);
#end
            }
#end
        }
    }
#for t in 0..$TW
    if (first_time + ${t}u < p.nt) {
        let motion = LibMotion(a$t.xyz, vec3<f32>(a$t.w, b$t.xy), vec3<f32>(b$t.zw, c$t));
        let moved = lib_moved(motion, LibAnchor(first.xyz, second.xyz), p.min_norm);
        let result = lib_gate(p.gate, p.threshold, first.w, third.xyz, moved);
        let dest = p.y_rest + (first_time + ${t}u) * p.step + i * 3u;
        y[dest] = result.x;
        y[dest + 1u] = result.y;
        y[dest + 2u] = result.z;
    }
#end
    if (first_time + p.skip == 0u) {
        theta[p.theta_rest + i] = first.w;
    }
}
