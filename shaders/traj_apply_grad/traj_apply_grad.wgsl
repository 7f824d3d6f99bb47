// traj_apply_grad: the gradient of traj_apply (lib/motion has the equations), any WebGPU device.
//
//   y[t, i] = gate(theta, x, moved),  moved = R(t) R(own)^T x + c(t) - c(own),  theta = tau[i, 9 T]
//
// Of dy [T, n, 3] and dtheta [n] (absent: 0) to dtau [n, 9 T + 1] and dx [n, 3]. The hard gate has the value [theta > threshold] and
// the gradient of theta itself (straight-through): the score of every pixel learns from sum_t dy . (moved - x), moved or not.
// Where a norm is below min_norm, the division is by a constant.
//
// An invocation owns a pixel and walks the times in order; what the own time collects from all of them is added at the end.
// Times may come in several dispatches: `state` [n, 10] holds what has been collected.
#import motion
#import grid

const HAS_THETA: u32 = 1u;
const GO_ON: u32 = 2u;
const LAST: u32 = 4u;

struct Params {
    // Pixels of this dispatch.
    n: u32,
    // Times of tau, first time and number of times of this dispatch.
    times: u32,
    t0: u32,
    nt: u32,
    // Words of dy from one time to the next.
    step: u32,
    relative: u32,
    gate: u32,
    threshold: f32,
    min_norm: f32,
    // Distances of the first word from the start of the windows; tau and dtau, x and dx have one.
    tau_rest: u32,
    x_rest: u32,
    dy_rest: u32,
    theta_rest: u32,
    state_rest: u32,
    flags: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> tau: array<f32>;
@group(0) @binding(2) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> own: array<u32>;
@group(0) @binding(4) var<storage, read> dy: array<f32>;
@group(0) @binding(5) var<storage, read> dtheta: array<f32>;
@group(0) @binding(6) var<storage, read_write> dtau: array<f32>;
@group(0) @binding(7) var<storage, read_write> dx: array<f32>;
@group(0) @binding(8) var<storage, read_write> state: array<f32>;

fn motion_at(at: u32) -> LibMotion {
    return LibMotion(
        vec3<f32>(tau[at], tau[at + 1u], tau[at + 2u]),
        vec3<f32>(tau[at + 3u], tau[at + 4u], tau[at + 5u]),
        vec3<f32>(tau[at + 6u], tau[at + 7u], tau[at + 8u]));
}

// Of g, the gradient of e = v / max(|v|, min_norm), to that of v.
fn unit_grad(v: vec3<f32>, e: vec3<f32>, g: vec3<f32>) -> vec3<f32> {
    let size = sqrt(lib_dot(v, v));
    let along = select(0.0, lib_dot(e, g), size >= p.min_norm);
    return fma(vec3<f32>(-along), e, g) / max(size, p.min_norm);
}

// Of the gradients of the columns of the rotation to those of a and b (c is 0).
fn rotation_grad(m: LibMotion, r: LibFrame, columns: LibFrame) -> LibMotion {
    // e3 = e1 x e2.
    let g1 = columns.e1 + cross(r.e2, columns.e3);
    let g2 = columns.e2 + cross(columns.e3, r.e1);
    // u = b - (b . e1) e1.
    let along = lib_dot(m.b, r.e1);
    let u = fma(vec3<f32>(-along), r.e1, m.b);
    let gu = unit_grad(u, r.e2, g2);
    let back = lib_dot(gu, r.e1);
    let gb = fma(vec3<f32>(-back), r.e1, gu);
    let ga = unit_grad(m.a, r.e1, g1 - along * gu - back * m.b);
    return LibMotion(ga, gb, vec3<f32>(0.0));
}

fn add(at: u32, m: LibMotion) {
#for c in 0..3
    dtau[at + ${c}u] += m.a[$c];
    dtau[at + ${c+3}u] += m.b[$c];
    dtau[at + ${c+6}u] += m.c[$c];
#end
}

fn put(at: u32, m: LibMotion) {
#for c in 0..3
    dtau[at + ${c}u] = m.a[$c];
    dtau[at + ${c+3}u] = m.b[$c];
    dtau[at + ${c+6}u] = m.c[$c];
#end
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
    let own_at = row + min(own[0], p.times - 1u) * 9u;
    let own_motion = motion_at(own_at);
    var anchor = LibAnchor(point, vec3<f32>(0.0));
    if (p.relative != 0u) {
        anchor = lib_anchor(own_motion, point, p.min_norm);
    }
    // Gradients of the anchor's point and of its translation, of the point where it stands still, of the score.
    var to_anchor = vec3<f32>(0.0);
    var to_shift = vec3<f32>(0.0);
    var to_point = vec3<f32>(0.0);
    var to_score = 0.0;
    let kept = p.state_rest + i * 10u;
    if ((p.flags & GO_ON) != 0u) {
        to_anchor = vec3<f32>(state[kept], state[kept + 1u], state[kept + 2u]);
        to_shift = vec3<f32>(state[kept + 3u], state[kept + 4u], state[kept + 5u]);
        to_point = vec3<f32>(state[kept + 6u], state[kept + 7u], state[kept + 8u]);
        to_score = state[kept + 9u];
    }
    var source = p.dy_rest + i * 3u;
    for (var t = 0u; t < p.nt; t++) {
        let at = row + (p.t0 + t) * 9u;
        let m = motion_at(at);
        let g = vec3<f32>(dy[source], dy[source + 1u], dy[source + 2u]);
        source += p.step;
        var g_moved = g;
        var g_still = vec3<f32>(0.0);
        if (p.gate == GATE_HARD) {
            let moves = score > p.threshold;
            g_moved = select(vec3<f32>(0.0), g, moves);
            g_still = select(g, vec3<f32>(0.0), moves);
        }
        if (p.gate == GATE_BLEND) {
            g_moved = g * score;
            g_still = g - g_moved;
        }
        if (p.gate != GATE_NONE) {
            to_score += lib_dot(g, lib_moved(m, anchor, p.min_norm) - point);
        }
        let r = lib_rotation(m.a, m.b, p.min_norm);
        let columns = LibFrame(anchor.x.x * g_moved, anchor.x.y * g_moved, anchor.x.z * g_moved);
        let to_motion = rotation_grad(m, r, columns);
        put(at, LibMotion(to_motion.a, to_motion.b, g_moved));
        to_anchor += vec3<f32>(lib_dot(r.e1, g_moved), lib_dot(r.e2, g_moved), lib_dot(r.e3, g_moved));
        to_shift -= g_moved;
        to_point += g_still;
    }
    if ((p.flags & LAST) == 0u) {
#for c in 0..3
        state[kept + ${c}u] = to_anchor[$c];
        state[kept + ${c+3}u] = to_shift[$c];
        state[kept + ${c+6}u] = to_point[$c];
#end
        state[kept + 9u] = to_score;
        return;
    }
    if (p.relative != 0u) {
        let r = lib_rotation(own_motion.a, own_motion.b, p.min_norm);
        to_point += fma(r.e3, vec3<f32>(to_anchor.z), fma(r.e2, vec3<f32>(to_anchor.y), r.e1 * to_anchor.x));
        let columns = LibFrame(to_anchor.x * point, to_anchor.y * point, to_anchor.z * point);
        let to_motion = rotation_grad(own_motion, r, columns);
        add(own_at, LibMotion(to_motion.a, to_motion.b, to_shift));
    } else {
        to_point += to_anchor;
    }
    if ((p.flags & HAS_THETA) != 0u) {
        to_score += dtheta[p.theta_rest + i];
    }
    dtau[row + p.times * 9u] = to_score;
#for c in 0..3
    dx[from_x + ${c}u] = to_point[$c];
#end
}
