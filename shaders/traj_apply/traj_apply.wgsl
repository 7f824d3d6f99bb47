// traj_apply: the points of one source image at all target times, any WebGPU device:
//
//   y[t, i] = gate(theta[i], x[i], moved(tau[i, 9 t .. 9 t + 9], x[i])),  theta[i] = tau[i, 9 T]
//
// moved and gate are in lib/motion. tau [n, 9 T + 1], x [n, 3], own [1] the image's own time, y [T, n, 3], theta [n].
// A dispatch owns n pixels and nt times from t0.
#import motion
#import grid

struct Params {
    // Pixels of this dispatch.
    n: u32,
    // Times of tau, first time and number of times of this dispatch.
    times: u32,
    t0: u32,
    nt: u32,
    // Words of y from one time to the next.
    step: u32,
    relative: u32,
    gate: u32,
    threshold: f32,
    min_norm: f32,
    // Distances of the first word from the start of the windows.
    tau_rest: u32,
    x_rest: u32,
    y_rest: u32,
    theta_rest: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> tau: array<f32>;
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> own: array<u32>;
@group(0) @binding(4) var<storage, read_write> y: array<f32>;
@group(0) @binding(5) var<storage, read_write> theta: array<f32>;

fn motion_at(at: u32) -> LibMotion {
    return LibMotion(
        vec3<f32>(tau[at], tau[at + 1u], tau[at + 2u]),
        vec3<f32>(tau[at + 3u], tau[at + 4u], tau[at + 5u]),
        vec3<f32>(tau[at + 6u], tau[at + 7u], tau[at + 8u]));
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.n) {
        return;
    }
    let row = p.tau_rest + i * (p.times * 9u + 1u);
    let from_x = p.x_rest + i * 3u;
    let point = vec3<f32>(x[from_x], x[from_x + 1u], x[from_x + 2u]);
    let score = tau[row + p.times * 9u];
    theta[p.theta_rest + i] = score;
    var anchor = LibAnchor(point, vec3<f32>(0.0));
    if (p.relative != 0u) {
        anchor = lib_anchor(motion_at(row + min(own[0], p.times - 1u) * 9u), point, p.min_norm);
    }
    var dest = p.y_rest + i * 3u;
    for (var t = 0u; t < p.nt; t++) {
        let moved = lib_moved(motion_at(row + (p.t0 + t) * 9u), anchor, p.min_norm);
        let result = lib_gate(p.gate, p.threshold, score, point, moved);
        y[dest] = result.x;
        y[dest + 1u] = result.y;
        y[dest + 2u] = result.z;
        dest += p.step;
    }
}
