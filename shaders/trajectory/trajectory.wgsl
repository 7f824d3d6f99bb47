// trajectory: `deform_sample` and `traj_apply` in one, for a range of target times, any WebGPU device; tau is never stored:
//
//   y[j, i] = gate(theta[i], x[i], moved(tau(i, t0 + j), x[i])),  theta[i] = sum_{l, q} weights[i, l, q] B(mask)
//
// tau and B: lib/deform_params; moved and gate: lib/motion; when = (own time of the image, t0). offsets, weights, pixels,
// field and mask as in deform_sample; x [n, 3], y [nt, n, 3], theta [n].
//
// Two steps, with the same sums in the same order as the two kernels. OWN: theta, the point at its own time and its
// place, one pixel per invocation, into anchor [n, 12]; then one pixel and time per invocation. Eight storage buffers is
// what WebGPU promises, which is why the second step finds everything about the pixel in anchor.
#import deform_params
#import motion
#import grid

@group(0) @binding(1) var<storage, read> offsets: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> field: array<f32>;
@group(0) @binding(4) var<storage, read> when: array<u32>;
#if OWN
@group(0) @binding(5) var<storage, read> pixels: array<u32>;
@group(0) @binding(6) var<storage, read> mask: array<f32>;
@group(0) @binding(7) var<storage, read> x: array<f32>;
// R(own)^T x, theta | c(own), place.x | x, place.y
@group(0) @binding(8) var<storage, read_write> anchor: array<vec4<f32>>;
#import deform_theta
#else
@group(0) @binding(5) var<storage, read> anchor: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;
@group(0) @binding(7) var<storage, read_write> theta: array<f32>;
#endif
#import deform_field

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
#if OWN
    let i = index;
    if (i >= p.n) {
        return;
    }
    var pixel = p.first + i;
    if ((p.flags & LISTED) != 0u) {
        pixel = pixels[p.i_rest + i];
    }
    let reference = lib_reference(pixel);
    let from_x = p.x_rest + i * 3u;
    let point = vec3<f32>(x[from_x], x[from_x + 1u], x[from_x + 2u]);
    var at_own = LibAnchor(point, vec3<f32>(0.0));
    if ((p.flags & RELATIVE) != 0u) {
        at_own = lib_anchor(lib_sample(i, reference, min(when[0], p.times - 1u)), point, p.min_norm);
    }
    let dest = p.y_rest + i * 3u;
    anchor[dest] = vec4<f32>(at_own.x, lib_theta(i, reference));
    anchor[dest + 1u] = vec4<f32>(at_own.c, reference.x);
    anchor[dest + 2u] = vec4<f32>(point, reference.y);
#else
    // Neighbouring invocations are neighbouring pixels.
    let t = index / p.n;
    let i = index - t * p.n;
    if (t >= p.nt) {
        return;
    }
    let at = p.x_rest + i * 3u;
    let first = anchor[at];
    let second = anchor[at + 1u];
    let third = anchor[at + 2u];
    let target_time = min(when[1] + p.skip + t, p.times - 1u);
    let motion = lib_sample(i, vec2<f32>(second.w, third.w), target_time);
    let moved = lib_moved(motion, LibAnchor(first.xyz, second.xyz), p.min_norm);
    let result = lib_gate(p.gate, p.threshold, first.w, third.xyz, moved);
    let dest = p.y_rest + t * p.step + i * 3u;
    y[dest] = result.x;
    y[dest + 1u] = result.y;
    y[dest + 2u] = result.z;
    if (t + p.skip == 0u) {
        theta[p.theta_rest + i] = first.w;
    }
#endif
}
