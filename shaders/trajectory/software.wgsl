// trajectory, software devices: see trajectory.wgsl for the equation, pack.wgsl for what the field looks like here.
//
// A workgroup of 8 lanes owns 8 pixels and $TW times. A storage gather costs a software rasteriser four times as much as one
// from a uniform window, so every level has a 64 KiB window of its own, which holds some slots of the packed field; the
// cells and weights of a point are found once for all $TW times. The mask rides along as the tenth channel. Same sums
// in the same order as the other variants. No workgroup memory, no barrier. Needs at most four levels.
#import deform_params
#import motion
#import grid
#import quad

@group(0) @binding(1) var<storage, read> offsets: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<uniform> f0: array<Quad, 4096>;
@group(0) @binding(4) var<uniform> f1: array<Quad, 4096>;
@group(0) @binding(5) var<uniform> f2: array<Quad, 4096>;
@group(0) @binding(6) var<uniform> f3: array<Quad, 4096>;
#if OWN
@group(0) @binding(7) var<storage, read> pixels: array<u32>;
@group(0) @binding(8) var<storage, read> x: array<f32>;
@group(0) @binding(9) var<storage, read_write> anchor: array<vec4<f32>>;
#else
@group(0) @binding(7) var<storage, read> anchor: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> y: array<f32>;
@group(0) @binding(9) var<storage, read_write> theta: array<f32>;
#endif

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let tiles = (p.n + 7u) / 8u;
    let first_time = tile / tiles * ${TW}u;
    if (first_time >= p.nt) {
        return;
    }
    let index = tile % tiles * 8u + local.x;
    // Lanes past the end repeat the last pixel and write nothing.
    let i = min(index, p.n - 1u);
#if OWN
    var pixel = p.first + i;
    if ((p.flags & LISTED) != 0u) {
        pixel = pixels[p.i_rest + i];
    }
    let reference = lib_reference(pixel);
    let point_at = p.x_rest + i * 3u;
    let point = vec3<f32>(x[point_at], x[point_at + 1u], x[point_at + 2u]);
#else
    let pixel_at = p.x_rest + i * 3u;
    let first = anchor[pixel_at];
    let second = anchor[pixel_at + 1u];
    let third = anchor[pixel_at + 2u];
    let reference = vec2<f32>(second.w, third.w);
#endif
#for t in 0..$TW
    let slot$t = min(first_time + ${t}u, p.nt - 1u) * p.slot;
    var a$t = vec4<f32>(0.0);
    var b$t = vec4<f32>(0.0);
    var c$t = vec4<f32>(0.0);
#end
    var o = p.o_rest / 2u + i * p.levels * p.points;
    var w = p.w_rest + i * p.levels * p.points;
#for l in 0..4
    if (p.levels > ${l}u) {
        for (var j = 0u; j < p.points; j++) {
            let taps = lib_taps(reference, offsets[o], weights[w]);
            o += 1u;
            w += 1u;
#for c in 0..4
            {
                let at = taps.cell[$c] * 3u;
                let weight = vec4<f32>(taps.weight[$c]);
#for t in 0..$TW
                a$t = fma(weight, lib_quad(f$l[at + slot$t]), a$t);
                b$t = fma(weight, lib_quad(f$l[at + slot$t + 1u]), b$t);
                c$t = fma(weight, lib_quad(f$l[at + slot$t + 2u]), c$t);
#end
            }
#end
        }
    }
#end
    if (index >= p.n) {
        return;
    }
#if OWN
    var at_own = LibAnchor(point, vec3<f32>(0.0));
    if ((p.flags & RELATIVE) != 0u) {
        let motion = LibMotion(a0.xyz, vec3<f32>(a0.w, b0.xy), vec3<f32>(b0.zw, c0.x));
        at_own = lib_anchor(motion, point, p.min_norm);
    }
    let dest = p.y_rest + i * 3u;
    anchor[dest] = vec4<f32>(at_own.x, c0.y);
    anchor[dest + 1u] = vec4<f32>(at_own.c, reference.x);
    anchor[dest + 2u] = vec4<f32>(point, reference.y);
#else
#for t in 0..$TW
    if (first_time + ${t}u < p.nt) {
        let motion = LibMotion(a$t.xyz, vec3<f32>(a$t.w, b$t.xy), vec3<f32>(b$t.zw, c$t.x));
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
#endif
}
